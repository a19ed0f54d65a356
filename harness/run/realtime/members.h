// The nodes that take part in a run: who they are, and whether each is still there.
#pragma once

#include <array>
#include <chrono>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "harness/dds/bus.h"
#include "harness/dds/messages.h"
#include "harness/process/own_time.h"
#include "harness/run/realtime/node_processes.h"
#include "harness/scenario/client_spec.h"

namespace tiltproof::harness {

// A client of the flight whose nodes are looked for.
struct SoughtClient {
  std::string id;        // of one of several clients; empty: the only one
  bool has_node = true;  // a board is on its link node's port and has none
};

// A line between clients of the flight.
struct SoughtLine {
  std::string id;
  std::array<std::size_t, 2> clients = {};  // at its ends: their places
};

struct Member {
  std::string id;  // node id
  dds::Participant participant;
  std::string role;  // of a process of ours: its name there
  dds::NodeKind kind{};
  // A client or link node's: the client's place in the scenario. A line node's: that of the line.
  std::size_t place = 0;
  std::string part;  // "plant", "link", "link-b": as faults name it
  std::string host;
  bool has_cable = false;  // a client or link node: the other one is at the far end of serial cables
  std::array<bool, 2> has_device = {};  // a line node: at its ends
  // The firmware that it is, or the link node's board: the kind alone.
  std::optional<ClientSpec> client;
  bool lost = false;
  bool kept_away = false;  // by a fault, just now
  std::optional<std::chrono::steady_clock::time_point> silent_since;
  std::optional<OwnTime> silent_for;  // a process of ours: how much time of its own it has been silent for
};

// A change that Watch() saw.
struct MemberChange {
  enum class Kind { kSilent, kBack, kLost } kind;
  std::string role;
  bool firmware = false;  // it is the node of the firmware under test
  bool hung = false;      // lost: it does not answer; otherwise it has ended
  std::string text;
  // Lost after it had been silent: the last moment at which it may have been there.
  std::optional<std::chrono::steady_clock::time_point> heard_last = {};
};

class Members {
 public:
  // An attached node may only be cut off for a moment: it is lost when it stays away so long.
  static constexpr std::chrono::milliseconds kPartitionLimit{5'000};
  // A process of ours that lives is hung when, after its lease, it is silent for so long of its own time: a machine
  // that lets it wait for a processor does not make it hang.
  static constexpr std::chrono::milliseconds kHangLimit{800};
  // So many strangers are named in a run.
  static constexpr std::size_t kStrangersMax = 8;

  // Takes the nodes that a run needs, one of each, out of those that are heard; of several of one kind the first by
  // node id. Client and link nodes are one of each for every client, line nodes one for every line. With `processes`, those
  // alone that are our processes. False, and `missing` says what is not there ("plant node and no link node"), when they
  // are not complete.
  bool Adopt(const std::vector<dds::NodeLife>& nodes, NodeProcesses* processes,
             const std::vector<SoughtClient>& clients, const std::vector<SoughtLine>& lines,
             const std::string& run_id, std::string& missing);
  // Nodes that could be taken for members, by kind or by name, and are not: each once, and the first few alone.
  std::vector<std::string> NewStrangers(const std::vector<dds::NodeLife>& nodes, const std::string& run_id);
  // The nodes that must share a host do, and cables have two ends; std::runtime_error names a node for which that does not
  // hold.
  void CheckHosts() const;

  // Changes since the last call. A process of ours is lost when it has ended, or missed its lease (200 ms) and is
  // stopped, or stays silent; an attached node (`processes` null), and one that is cut off by a fault, when it
  // stays away for kPartitionLimit. A client that falls silent together with others of its host is no fault of
  // the firmware, nor is the silence of a node whose firmware runs outside of it. Roles in `excused` are kept away by a fault. Roles in `paused` are stopped by one, which excuses
  // nothing: a firmware that stands still for so long hangs.
  std::vector<MemberChange> Watch(const std::vector<dds::NodeLife>& nodes, NodeProcesses* processes,
                                  const std::set<std::string>& excused, const std::set<std::string>& paused,
                                  std::chrono::steady_clock::time_point now);

  // A new process has taken the member's place.
  void Replace(Member& member, const std::string& id, const dds::Participant& participant);

  std::vector<Member>& all() { return members_; }
  const std::vector<Member>& all() const { return members_; }
  // True if one is silent, not yet given up, and not kept away by a fault.
  bool AnySilent() const;
  // Null when there is none. `place`: as of Member.
  const Member* Find(dds::NodeKind kind, std::size_t place = 0) const;
  Member* FindRole(const std::string& role);
  // The base station or the joystick.
  const Member& reference_sender() const;

 private:
  void LoseEnded(NodeProcesses& processes, const std::function<bool(const std::string&)>& is_excused,
                 std::vector<MemberChange>& changes);
  // `process`: null when it is none of ours.
  void JudgeSilent(Member& member, ChildProcess* process, const std::set<std::string>& paused,
                   std::chrono::steady_clock::time_point now, std::vector<MemberChange>& changes);
  // `blame`: whether the firmware is to answer for it when it is the client's node.
  void Lose(Member& member, const std::string& how, std::vector<MemberChange>& changes, bool blame,
            bool hung);
  void CheckEnds(const Member& line) const;
  // Another node of its host is silent too: then it is the host or the network, not this node.
  bool HostIsSilent(const Member& member) const;
  // The member that the node would be, or that is in its place. Null: none is, and the node's client is none of ours.
  const Member* FindPlaceOf(dds::NodeKind kind, std::size_t place) const;
  // The place of the client or line whose node it is; nullopt when it is none of the flight's.
  std::optional<std::size_t> PlaceOf(const dds::Heartbeat& said) const;

  std::vector<Member> members_;
  std::vector<SoughtClient> clients_;
  std::vector<SoughtLine> lines_;
  std::set<dds::Participant> strangers_;
};

}  // namespace tiltproof::harness
