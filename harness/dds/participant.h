// Who speaks on the bus, and whom to listen to.
//
// Any process on a domain can write any message under any name. What it cannot choose is the participant that its
// messages come from: DDS itself tells that with each message. So a run knows its nodes by their participants.
//
//   Circle members;
//   members.Admit(node.participant, "plant");
//   Subscriber<RunAck> acks(bus, members, wake);  // hears only members, and "plant" from that participant alone
#pragma once

#include <array>
#include <compare>
#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <string>

namespace tiltproof::dds {

// The identity of a process on the bus: the GUID of its DDS participant. New for each Bus.
struct Participant {
  std::array<std::uint8_t, 16> guid{};
  // NOLINTNEXTLINE(modernize-use-nullptr): of clang-tidy 14 on any defaulted comparison
  auto operator<=>(const Participant&) const = default;
};
// 32 hexadecimal digits, and back; nullopt for anything else.
std::string ToText(const Participant& participant);
std::optional<Participant> ParticipantNamed(const std::string& text);

// Those that a subscriber listens to, each with the node id under which it speaks. For any thread.
class Circle {
 public:
  // An empty node id: under any.
  void Admit(const Participant& participant, const std::string& node_id);
  // Drops a participant's messages from now on, those included that it has sent and that were not taken.
  void Expel(const Participant& participant);
  void Clear();
  // The node id of one that is admitted.
  std::optional<std::string> NodeId(const Participant& participant) const;

 private:
  mutable std::mutex mutex_;
  std::map<Participant, std::string> node_ids_;
};

}  // namespace tiltproof::dds
