// The messages between the harness and its processes in a lockstep flight: a request, then any number of
// upcalls (the firmware transmits, the firmware logs), then one answer.
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "harness/client/make_client.h"
#include "harness/run/line.h"
#include "harness/run/plant_server.h"
#include "harness/run/remote/archive.h"
#include "link/protocol.h"

namespace tiltproof::harness {

enum class Message : std::uint8_t {
  // Requests.
  kSetup,
  kTakeLog,
  kQuit,
  kTransmit,
  kTakePiece,
  kSetOrigin,
  kAdvance,
  kServe,
  kFinish,
  kHear,
  kStart,
  kReceive,
  kGrant,
  kCommand,
  kStatus,
  // Upcalls of the client.
  kClientTransmits,
  kClientLogs,
  kClientEvent,
  // Answers.
  kDone,
  kFailed,          // text
  kFirmwareFailed,  // hung, text: FirmwareTrouble
};

// What a process is told before the flight.
struct Setup {
  std::string scenario_yaml;
  std::string client;     // as --client names it
  std::size_t place = 0;  // among the scenario's clients: of the process's client or line
};

// What the line's process answers besides the result, so that the harness need not ask.
struct LineView {
  std::array<BootTime, link::kDirectionCount> next_arrival_ns{BootTime::Never(), BootTime::Never(),
                                                              BootTime::Never()};
  LineCounts counts{};
  std::optional<Overfull> overfull;
  std::vector<faults::News> news;
};

// A link::Message: both processes have the scenario, and so the protocol's table.
struct PackedMessage {
  std::string type;
  std::vector<float> values;
};
inline PackedMessage Packed(const link::Message& message) { return {message.type->name, message.values}; }
inline link::Message Unpacked(const PackedMessage& packed, const link::Protocol& protocol) {
  const link::MessageType* type = protocol.Find(packed.type);
  if (type == nullptr || packed.values.size() != type->fields.size())
    throw std::runtime_error("a message that the protocol does not have");
  return {type, packed.values};
}

template <class Archive>
void Fields(Archive& archive, PackedMessage& m) {
  archive(m.type, m.values);
}
template <class Archive>
void Fields(Archive& archive, Setup& s) {
  archive(s.scenario_yaml, s.client, s.place);
}
template <class Archive>
void Fields(Archive& archive, DeviceEvent& e) {
  archive(e.time_ns, e.fault, e.kind, e.text, e.overruns_count);
}
template <class Archive>
void Fields(Archive& archive, DirectionCounts& c) {
  archive(c.frames_sent, c.frames_accepted, c.frames_rejected, c.bytes_corrupted);
}
template <class Archive>
void Fields(Archive& archive, Overfull& o) {
  archive(o.by_faults, o.text);
}
template <class Archive>
void Fields(Archive& archive, LineView& v) {
  archive(v.next_arrival_ns, v.counts, v.overfull, v.news);
}
template <class Archive>
void Fields(Archive& archive, ClientStatus& s) {
  archive(s.supervisor_state, s.failsafe_count);
}
template <class Archive, class Time>
void Fields(Archive& archive, TimedEvent<Time>& e) {
  archive(e.time_ns, e.kind, e.text, e.client);
}
template <class Archive>
void Fields(Archive& archive, PlantServer::State& s) {
  archive(s.origin, s.reached_ns, s.quiet_until_ns, s.over, s.end_reason, s.end_text);
}
template <class Archive>
void Fields(Archive& archive, PlantClientLog& l) {
  archive(l.starts_accepted_count, l.request_times_ns, l.actuator_times_ns);
}
template <class Archive>
void Fields(Archive& archive, PlantLog& l) {
  archive(l.rows, l.column_count, l.hover_input, l.input_min, l.input_max, l.clients, l.events, l.activations,
          l.activation_counts);
}
template <class Time>
void Fields(Packer& packer, TimedLinkLog<Time>& l) {
  packer(l.content());
}
template <class Time>
void Fields(Unpacker& unpacker, TimedLinkLog<Time>& l) {
  l = TimedLinkLog<Time>(unpacker.Next<std::vector<std::uint8_t>>());
}
template <class Archive>
void Fields(Archive& archive, LineLog& l) {
  archive(l.link, l.reply_latency_ns, l.client_round_trip_ns, l.events, l.activations, l.activation_counts,
          l.counts, l.accepted_wrong_count, l.accepted_stale_count, l.resync_max_ns);
}

}  // namespace tiltproof::harness

// In the namespaces of their structs, where the archives find them.
namespace tiltproof::link {
template <class Archive, class Time>
void Fields(Archive& archive, TimedChunk<Time>& c) {
  archive(c.begin_ns, c.bytes, c.kind, c.number);
}
}  // namespace tiltproof::link
namespace tiltproof::faults {
template <class Archive>
void Fields(Archive& archive, News& n) {
  archive(n.kind, n.fault, n.time_ns);
}
template <class Archive>
void Fields(Archive& archive, Activation& a) {
  archive(a.time_ns, a.fault, a.what, a.before, a.after);
}
}  // namespace tiltproof::faults
