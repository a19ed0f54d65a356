// The record of a flight as a stream: each record has a time, a client and a body. Every part of a flight writes to
// one sink, in one process (lockstep), from other processes (lockstep, distributed) or over the bus (real time).
//
//   sink.Write({12 * kNsPerMs, 0, record::Event{"start_repeated", "the client sent `start` again"}});
//
// LogBuilder (harness/run/log_builder.h) turns the stream into a RunLog.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "faults/fault.h"
#include "harness/client/firmware_end.h"
#include "harness/client/stack_use.h"
#include "harness/run/firmware_use.h"
#include "harness/run/link_log.h"
#include "harness/run/run_log.h"
#include "link/fields.h"
#include "link/time.h"

namespace tiltproof::harness {

namespace record {

// A row of the trace (TraceLayout). Its watched variables are NaN, because they follow as Watched.
struct Row {
  std::vector<double> values;
  TILTPROOF_FIELDS(values)
};

// Bytes on a wire of the client's line; the first of them starts at the record's time.
struct Bytes {
  link::Direction direction{};
  ByteSide side{};
  std::vector<std::uint8_t> bytes;
  TILTPROOF_FIELDS(direction, side, bytes)
};

// Real time: the counters of the client's line at this time. The rows of a plant node do not have them.
struct Counters {
  LineCounts counts{};
  TILTPROOF_FIELDS(counts)
};

struct Event {
  std::string kind, text;
  TILTPROOF_FIELDS(kind, text)
};

// A line that the firmware printed.
struct FirmwareText {
  std::string text;
  TILTPROOF_FIELDS(text)
};

// The server accepted a message of the client, whose last byte arrived at this time.
enum class AcceptedKind : std::uint8_t { kRequest, kActuators };
struct Accepted {
  AcceptedKind kind{};
  TILTPROOF_FIELDS(kind)
};

// The last byte of a reply arrived at the client, this long after that of its request at the server.
struct Reply {
  TimeNs latency_ns = 0;
  TILTPROOF_FIELDS(latency_ns)
};

// Actuators arrived at the server, this long after the reply that they answer at the client.
struct Answer {
  TimeNs round_trip_ns = 0;
  TILTPROOF_FIELDS(round_trip_ns)
};

// The state of the client's supervisor, in the firmware's own numbering.
struct State {
  std::uint32_t state = 0;
  TILTPROOF_FIELDS(state)
};

// The client's role among several, as it tells it (ClientRole).
struct Role {
  std::uint32_t role = 0;
  TILTPROOF_FIELDS(role)
};

// The watched variables of the client, in the scenario's order.
struct Watched {
  std::vector<double> values;
  TILTPROOF_FIELDS(values)
};

// Late from the record's time to `end_ns`.
enum class LateKind : std::uint8_t {
  kNode,
  kBoard,  // the machine took time from the program that represents the board
};
struct Late {
  TimeNs end_ns = 0;
  LateKind kind{};
  std::string processors = {};  // of the node; see FirmwareUse
  TILTPROOF_FIELDS(end_ns, kind, processors)
};

// Number of times that each fault of the scenario acted in one part.
struct ActivationCounts {
  std::vector<std::int64_t> counts;
  TILTPROOF_FIELDS(counts)
};

// Totals of the plant and of the server's part of each client.
struct PlantEnd {
  std::vector<double> hover_input, input_min, input_max;
  std::vector<std::int64_t> starts_accepted_counts;
  std::optional<RedundancyTotals> redundancy = {};
  TILTPROOF_FIELDS(hover_input, input_min, input_max, starts_accepted_counts, redundancy)
};

// Totals of the client's line.
struct LineEnd {
  LineCounts counts{};
  std::int64_t accepted_wrong_count = 0;
  std::int64_t accepted_stale_count = 0;
  TimeNs resync_max_ns = 0;
  TILTPROOF_FIELDS(counts, accepted_wrong_count, accepted_stale_count, resync_max_ns)
};

// Totals of the client; see ClientLog.
struct ClientEnd {
  std::optional<std::int64_t> failsafe_entered_count = {}, receive_overruns_count = {},
                              deadline_missed_count = {};
  std::vector<std::string> unmodelled_blocks = {};
  std::vector<StackUse> stacks = {};
  std::optional<FirmwareEnd> firmware_end = {};
  std::optional<ClientLoss> loss = {};
  TILTPROOF_FIELDS(failsafe_entered_count, receive_overruns_count, deadline_missed_count, unmodelled_blocks,
                   stacks, firmware_end, loss)
};

// Real time: the processor time of a program; `origin`: t = 0 by its node's clock.
struct FirmwareTime {
  FirmwareUse use = {};
  Origin origin = {};
  TILTPROOF_FIELDS(use, origin)
};

// The flight is over at the record's time. Only the conductor writes it.
struct End {
  EndReason reason = EndReason::kCompleted;
  std::string text = {};
  std::optional<FirmwareEnd> firmware_end = {};
  double wall_s = 0;
  TILTPROOF_FIELDS(reason, text, firmware_end, wall_s)
};

}  // namespace record

using RecordBody =
    std::variant<record::Row, record::Bytes, record::Counters, record::Event, record::FirmwareText,
                 record::Accepted, record::Reply, record::Answer, record::State, record::Role,
                 record::Watched, faults::Activation, record::ActivationCounts, record::Late,
                 record::PlantEnd, record::LineEnd, record::ClientEnd, record::FirmwareTime, record::End>;

struct Record {
  TimeNs time_ns = 0;                      // simulation time
  std::optional<std::size_t> client = {};  // its place in the scenario; none: the flight's
  RecordBody body = {};
  TILTPROOF_FIELDS(time_ns, client, body)
};

class RecordSink {
 public:
  virtual ~RecordSink() = default;
  virtual void Write(const Record& record) = 0;
};

}  // namespace tiltproof::harness
