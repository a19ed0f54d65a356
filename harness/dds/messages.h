// Messages between the nodes of a distributed run, as plain structs.
//
// Each struct here is one topic of tiltproof.idl, under the same names, and one row of topics.h; bus.h sends and
// receives them.
// Nothing here knows DDS, so code that only builds or reads a message needs no more than this header.
//
//   publisher.Write({.run_id = run, .node_id = "plant", .sequence = ++last, .time_ns = t, .kind = "started"});
//
// Conventions. A "key" member names the instance: QoS such as "the last one is kept" counts within it. A
// sequence starts at 1 and grows by 1 within its (run_id, node_id). time_ns is simulation time (link/time.h).
// Strings hold no NUL byte. Limits stand beside the members; Publisher::Write refuses what exceeds them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "link/fields.h"
#include "link/time.h"

namespace tiltproof::dds {

// Limits, in bytes of a string or elements of a list; the same numbers stand in tiltproof.idl.
inline constexpr std::size_t kIdBytesMax = 128;             // identifiers, names, kinds, host names, versions
inline constexpr std::size_t kPathBytesMax = 1024;          // paths of devices and sockets
inline constexpr std::size_t kTextBytesMax = 4096;          // texts for people
inline constexpr std::size_t kDocumentBytesMax = 262'144;   // a scenario file, all metrics of a score
inline constexpr std::size_t kPayloadBytesMax = 1'048'576;  // opaque octets
inline constexpr std::size_t kChunkBytesMax = 65'536;       // bytes of one chunk or frame on the serial line
inline constexpr std::size_t kNamesCountMax = 128;          // lists of names, ports or parameters
inline constexpr std::size_t kChunksCountMax = 4096;        // frames or chunks in one message
inline constexpr std::size_t kSignalsCountMax = 1024;       // signals of one vehicle
inline constexpr std::size_t kNumbersCountMax = 131'072;    // numbers in one message (1 MiB)

// A list with the limit that its message sets.
template <class T, std::size_t kMax>
struct List : std::vector<T> {
  static constexpr std::size_t kCountMax = kMax;
  using std::vector<T>::vector;
  List(std::vector<T> values) : std::vector<T>(std::move(values)) {}
};
using Names = List<std::string, kNamesCountMax>;
using Payload = List<std::uint8_t, kPayloadBytesMax>;

enum class NodeKind : std::uint8_t {
  kHarness,
  kPlant,
  kLink,
  kClient,
  kBaseStation,
  kJoystick,
  kMonitor,
  kLine
};
enum class Verb : std::uint8_t { kPrepare, kArm, kStart, kStop, kRelease, kInject };
enum class Phase : std::uint8_t { kIdle, kPrepared, kArmed, kRunning, kFinished, kFailed };

// Lower-case names, as in the command line and in files: "base_station", "prepare", "running".
std::string_view Name(NodeKind kind);
std::string_view Name(Verb verb);
std::string_view Name(Phase phase);
constexpr NodeKind LastOf(NodeKind) { return NodeKind::kLine; }
constexpr Verb LastOf(Verb) { return Verb::kInject; }
constexpr Phase LastOf(Phase) { return Phase::kFailed; }

// "I am here and not hung": written every 50 ms by the thread that does the node's work. Who misses it for
// 200 ms is seen as dead (Subscriber<Heartbeat>::Nodes).
struct Heartbeat {
  std::string node_id{};  // key
  NodeKind kind = NodeKind::kHarness;
  std::string host{};
  std::int64_t pid = 0;
  std::int64_t sequence = 0;
  std::string run_id{};  // "" = idle
  Names capabilities{};
  std::string version{};
  TILTPROOF_FIELDS(node_id, kind, host, pid, sequence, run_id, capabilities, version)
  bool operator==(const Heartbeat&) const = default;
};

// The flight to be flown. A node that comes late gets it, too.
struct RunScenario {
  std::string run_id{};         // key
  std::string scenario_yaml{};  // at most kDocumentBytesMax
  Names nodes{};                // node ids that take part
  Names participants{};         // which participant each of them is (participant.h)
  Names files{};                // what a node must have, too: "vehicle" (harness/run/flown_files.h)
  Names file_hashes{};          // of each
  TILTPROOF_FIELDS(run_id, scenario_yaml, nodes, participants, files, file_hashes)
  bool operator==(const RunScenario&) const = default;
};

// Where a node's serial line is reached: a device, a socket.
struct Port {
  std::string name{};
  std::string path{};  // at most kPathBytesMax
  TILTPROOF_FIELDS(name, path)
  bool operator==(const Port&) const = default;
};

// A fault to add while the flight goes on.
struct InjectedFault {
  std::string text{};  // an item of the scenario's faults, at most kPathBytesMax
  std::string id{};    // when the text has none
  TimeNs start_ns = 0;
  TILTPROOF_FIELDS(text, id, start_ns)
  bool operator==(const InjectedFault&) const = default;
};

// The harness to all nodes of a run. One at a time: the next only after every RunAck. A node that comes late
// gets the last one, and after a long partition a node may get it again: compare the sequence.
struct RunCommand {
  std::string run_id{};   // key
  std::string node_id{};  // the one it is for; "" = all of the run
  std::int64_t sequence = 0;
  Verb verb = Verb::kPrepare;
  List<Port, kNamesCountMax> ports{};
  std::string client_kind{};                     // prepare: of the run's client; empty: not known
  List<InjectedFault, kNamesCountMax> faults{};  // inject
  TILTPROOF_FIELDS(run_id, node_id, sequence, verb, ports, client_kind, faults)
  bool operator==(const RunCommand&) const = default;
};

struct RunAck {
  std::string run_id{};       // key
  std::string node_id{};      // key
  std::int64_t sequence = 0;  // of the command
  bool ok = false;
  std::string text{};  // why not
  List<Port, kNamesCountMax> ports{};
  // inject: from when on each of the faults acts on this node; empty: they do not act here.
  List<std::int64_t, kNamesCountMax> begins_ns{};
  TILTPROOF_FIELDS(run_id, node_id, sequence, ok, text, ports, begins_ns)
  bool operator==(const RunAck&) const = default;
};

// Where a node stands in a run.
struct RunState {
  std::string run_id{};   // key
  std::string node_id{};  // key
  Phase phase = Phase::kIdle;
  TimeNs time_ns = 0;
  std::int64_t origin_ns = 0;  // of the plant: its boot time at simulation time 0, 0 until that is known
  std::string end_reason{};
  std::string text{};
  // A client node's, of several clients: its client, and the role that it tells (harness/run/arbiter.h); -1: none so far. A
  // line node's that has failed: the client at whose end.
  std::string client_id{};
  std::int64_t role = -1;
  TILTPROOF_FIELDS(run_id, node_id, phase, time_ns, origin_ns, end_reason, text, client_id, role)
  bool operator==(const RunState&) const = default;
};

// Real time, the latest counts: the vehicle's true state and the inputs in force, in the order of its tables
// (plant/vehicle_model.h), which is that of the columns of trace.csv.
struct PlantState {
  std::string run_id{};  // key
  std::int64_t sequence = 0;
  TimeNs time_ns = 0;
  List<double, kSignalsCountMax> state{};  // of any vehicle the first six are x y z (m) roll pitch yaw (rad)
  List<double, kSignalsCountMax> in_force{};
  TILTPROOF_FIELDS(run_id, sequence, time_ns, state, in_force)
  bool operator==(const PlantState&) const = default;
};

// The reference as the base station or the joystick asks for it, in the order of ReferenceSignals()
// (harness/reference): x y z (m) yaw (rad) vx vy vz (m/s) in W.
struct Reference {
  std::string run_id{};  // key
  std::string node_id{};
  std::int64_t sequence = 0;
  TimeNs time_ns = 0;
  List<double, kSignalsCountMax> values{};
  TILTPROOF_FIELDS(run_id, node_id, sequence, time_ns, values)
  bool operator==(const Reference&) const = default;
};

// One frame as it passed the line.
struct TapFrame {
  TimeNs begin_ns = 0;
  std::uint8_t direction = 0;  // link's Direction: 0 to the plant, 1 to the client, 2 reference line
  bool delivered = false;
  List<std::uint8_t, kChunkBytesMax> bytes{};
  Names fault_ids{};  // what touched it
  TILTPROOF_FIELDS(begin_ns, direction, delivered, bytes, fault_ids)
  bool operator==(const TapFrame&) const = default;
};

// Log of the serial line.
struct SerialTap {
  std::string run_id{};   // key
  std::string node_id{};  // key
  std::int64_t sequence = 0;
  List<TapFrame, kChunksCountMax> frames{};
  List<std::int64_t, kNumbersCountMax> reply_latency_ns{};
  // From a reply to the actuators that answer it.
  List<std::int64_t, kNumbersCountMax> client_round_trip_ns{};
  TILTPROOF_FIELDS(run_id, node_id, sequence, frames, reply_latency_ns, client_round_trip_ns)
  bool operator==(const SerialTap&) const = default;
};

// A parameter of a fault, in the unit of the fault catalogue.
struct Parameter {
  std::string name{};
  double value = 0;
  TILTPROOF_FIELDS(name, value)
  bool operator==(const Parameter&) const = default;
};

// Asks the node to activate a fault now. Ids as in the scenario, parameters as in the fault catalogue.
struct FaultCommand {
  std::string run_id{};   // key
  std::string node_id{};  // key: the node that is to obey
  std::int64_t sequence = 0;
  std::string fault_id{};
  std::string type{};
  List<Parameter, kNamesCountMax> parameters{};
  std::int64_t duration_ns = 0;
  TILTPROOF_FIELDS(run_id, node_id, sequence, fault_id, type, parameters, duration_ns)
  bool operator==(const FaultCommand&) const = default;
};

// Bytes on the serial line from simulation time begin_ns on.
struct Chunk {
  TimeNs begin_ns = 0;
  List<std::uint8_t, kChunkBytesMax> bytes{};
  TILTPROOF_FIELDS(begin_ns, bytes)
  bool operator==(const Chunk&) const = default;
};

// Log of what faults did.
struct FaultActivation {
  std::string run_id{};   // key
  std::string node_id{};  // key
  std::int64_t sequence = 0;
  std::string fault_id{};
  TimeNs time_ns = 0;
  std::string what{};  // at most kTextBytesMax
  List<Chunk, kChunksCountMax> before{};
  List<Chunk, kChunksCountMax> after{};
  TILTPROOF_FIELDS(run_id, node_id, sequence, fault_id, time_ns, what, before, after)
  bool operator==(const FaultActivation&) const = default;
};

// Log of what happened to the run.
struct RunEvent {
  std::string run_id{};   // key
  std::string node_id{};  // key
  std::int64_t sequence = 0;
  TimeNs time_ns = 0;
  std::string kind{};
  std::string text{};
  TILTPROOF_FIELDS(run_id, node_id, sequence, time_ns, kind, text)
  bool operator==(const RunEvent&) const = default;
};

// A node's record of the flight without loss, as bytes for a program of the same build. The node has nothing more to say
// after the `last` message.
struct Records {
  std::string run_id{};   // key
  std::string node_id{};  // key
  std::int64_t sequence = 0;
  bool last = false;
  Payload payload{};
  TILTPROOF_FIELDS(run_id, node_id, sequence, last, payload)
  bool operator==(const Records&) const = default;
};

struct Score {
  std::string run_id{};  // key
  std::string scenario{};
  std::string verdict{};
  std::string reason{};        // at most kTextBytesMax
  std::string metrics_json{};  // at most kDocumentBytesMax
  TILTPROOF_FIELDS(run_id, scenario, verdict, reason, metrics_json)
  bool operator==(const Score&) const = default;
};

// A lockstep exchange with a node. None is lost, and none is kept for latecomers.
struct StepRequest {
  std::string run_id{};   // key
  std::string node_id{};  // key
  std::int64_t sequence = 0;
  Payload payload{};
  TILTPROOF_FIELDS(run_id, node_id, sequence, payload)
  bool operator==(const StepRequest&) const = default;
};

struct StepResponse {
  std::string run_id{};   // key
  std::string node_id{};  // key
  std::int64_t sequence = 0;
  Payload payload{};
  TILTPROOF_FIELDS(run_id, node_id, sequence, payload)
  bool operator==(const StepResponse&) const = default;
};

}  // namespace tiltproof::dds
