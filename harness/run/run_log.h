// The record of a flight: the only input of scoring, so that an old run can be scored again offline.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "faults/fault.h"
#include "harness/client/firmware_end.h"
#include "harness/client/stack_use.h"
#include "harness/run/link_log.h"
#include "harness/run/redundancy.h"
#include "harness/run/trace.h"
#include "link/chunk.h"
#include "link/fields.h"

namespace tiltproof::harness {

// Reason that a flight ended.
enum class EndReason : std::uint8_t {
  kCompleted,        // duration_s reached
  kDiverged,         // not finite, |position| > 1 km, tilt beyond 90 deg
  kGroundStrike,     // a touch of the ground that the scenario does not allow
  kNeverStarted,     // the server accepted no `start` within duration_s of power-on
  kFirmwareHung,     // a call into the client did not return
  kFirmwareCrashed,  // the client raised a fatal signal
  kInterrupted,      // Ctrl-C
  kNodeLost,         // a node of the harness's own was killed, hung or left
  kFirmwareLost,     // the firmware's process or port went away: killed, exited, unplugged, or its node hung
  kLineOverfull,     // the scenario's faults put more on a line than link::kLineBytesMax
  kHarnessError,     // ours
};
std::string_view Name(EndReason reason);
constexpr EndReason LastOf(EndReason) { return EndReason::kHarnessError; }
// Failures of the harness, or of the scenario, never blamed on the firmware.
constexpr bool IsOurs(EndReason reason) {
  return reason == EndReason::kHarnessError || reason == EndReason::kNodeLost ||
         reason == EndReason::kLineOverfull;
}
// A firmware that went away or hangs, which is judged by its own time, did so by itself, however late the harness was.
constexpr bool WentAway(EndReason reason) {
  return reason == EndReason::kFirmwareLost || reason == EndReason::kFirmwareCrashed ||
         reason == EndReason::kFirmwareHung;
}

// One event, for events.jsonl.
struct RunEvent {
  TimeNs time_ns = 0;
  std::string kind;  // "start_accepted", "command_refused", "ground_strike", ...
  std::string text;
  std::optional<std::size_t> client = {};  // place in the scenario of the event's client; none: the flight's
  TILTPROOF_FIELDS(time_ns, kind, text, client)
};
// Kinds of events: the first command refused, the first malformed frame, each repeated start of a firmware, and the first
// value of a field that the vehicle has and that the protocol's receiver refuses.
inline constexpr const char* kCommandRefusedEvent = "command_refused";
inline constexpr const char* kMalformedSentEvent = "malformed_sent";
inline constexpr const char* kStartRepeatedEvent = "start_repeated";
inline constexpr const char* kBeyondRangeSentEvent = "beyond_range_sent";

// A reboot of the firmware.
struct Restart {
  TimeNs time_ns = 0;
  std::string cause;  // for a person: "reset by watchdog"
  friend bool operator==(const Restart&, const Restart&) = default;
  TILTPROOF_FIELDS(time_ns, cause)
};

// Work of the harness that was due at the begin and done at the end. In a node the times are boot time.
template <class Time>
struct TimedLateSpan {
  Time begin_ns{}, end_ns{};
  friend bool operator==(const TimedLateSpan&, const TimedLateSpan&) = default;
  TILTPROOF_FIELDS(begin_ns, end_ns)
};
using LateSpan = TimedLateSpan<TimeNs>;
using NodeLateSpan = TimedLateSpan<BootTime>;

// bytes_corrupted: delivered bytes that were changed or inserted on the way. In a frame that kept its length,
// these are the bytes that differ from the byte sent in their place; in any other frame, the bytes outside
// the longest common subsequence with the frame as sent. Lost bytes are not delivered, and repeated frames
// count as they were sent.
// parity_errors: bytes that arrived with a wrong parity bit.
struct DirectionCounts {
  std::int64_t frames_sent = 0, frames_accepted = 0, frames_rejected = 0, bytes_corrupted = 0,
               parity_errors = 0;
  TILTPROOF_FIELDS(frames_sent, frames_accepted, frames_rejected, bytes_corrupted, parity_errors)
};

// A mistake that a flight counts, and the first of its kind.
struct CountedMistake {
  std::int64_t count = 0;
  TimeNs first_ns = 0;
  std::string text = {};  // what the first one was, for a person
  friend bool operator==(const CountedMistake&, const CountedMistake&) = default;
  TILTPROOF_FIELDS(count, first_ns, text)
};

// A client's use of its protocol (docs/criteria.md, protocol.*), whatever the faults on its line make of it. Where the
// server sends by itself, the first number counts commands, and all that need a request are 0 or absent.
struct ProtocolUse {
  std::int64_t requests_per_period_max = 0;
  std::int64_t actuators_per_request_max = 0;
  std::int64_t actuators_before_reply = 0;
  std::int64_t replies_unanswered = 0;
  std::int64_t malformed_sent = 0;
  // None: a log of an older program; the last two also where the server sends by itself.
  std::optional<std::int64_t> refused_commands = {};
  std::optional<CountedMistake> replies_ignored = {}, commands_without_reply = {};
  friend bool operator==(const ProtocolUse&, const ProtocolUse&) = default;
  TILTPROOF_FIELDS(requests_per_period_max, actuators_per_request_max, actuators_before_reply,
                   replies_unanswered, malformed_sent, refused_commands, replies_ignored,
                   commands_without_reply)
};

// Mistakes that no sound client makes while its line is whole (docs/criteria.md, clean_line). The score decides if a
// fault of the scenario excuses them.
enum class LineMistakeKind : std::uint8_t {
  kMalformed,   // a frame that is no message, or whose values no server takes
  kMissing,     // a period without a request, or without a command where the server sends by itself
  kDoubled,     // such a message less than half a period after the one before
  kUnanswered,  // a whole reply that no actuator message followed within a period
};
std::string_view Name(LineMistakeKind kind);
constexpr LineMistakeKind LastOf(LineMistakeKind) { return LineMistakeKind::kUnanswered; }

struct LineMistake {
  TimeNs time_ns = 0;  // of the frame, the expected request, the second request, the last byte of the reply
  LineMistakeKind kind{};
  std::int64_t count = 1;  // kMissing: so many, the others each a period later
  std::string text = {};   // kMalformed: why it was refused, and its bytes
  friend bool operator==(const LineMistake&, const LineMistake&) = default;
  TILTPROOF_FIELDS(time_ns, kind, count, text)
};

// The end of one of several clients before that of the flight.
struct ClientLoss {
  TimeNs time_ns = 0;
  bool hung = false;      // otherwise crashed
  std::string text = {};  // how, for a person
  FirmwareEnd end = {};
  friend bool operator==(const ClientLoss&, const ClientLoss&) = default;
  TILTPROOF_FIELDS(time_ns, hung, text, end)
};
// Kinds of the event of such an end.
inline constexpr const char* kClientCrashedEvent = "client_crashed";
inline constexpr const char* kClientHungEvent = "client_hung";

// Size of the firmware's log that is kept; the rest is dropped.
inline constexpr std::size_t kFirmwareLogBytesMax = 1 << 20;

// By Direction.
using LineCounts = std::array<DirectionCounts, link::kDirectionCount>;
// By client.
using AllCounts = std::vector<LineCounts>;
// Number of columns that a client's line has in a row of the trace (TraceLayout::link_counters).
inline constexpr std::size_t kLineCounters = 3 * link::kDirectionCount;
// Writes the counters of one line into its columns.
inline void PutCounters(const LineCounts& counts, std::span<double> columns) {
  std::size_t column = 0;
  for (const DirectionCounts& count : counts)
    for (const std::int64_t value : {count.frames_sent, count.frames_accepted, count.frames_rejected})
      columns[column++] = static_cast<double>(value);
}

// The record of one client and its line.
struct ClientLog {
  std::string id;  // with several clients; empty: the only client
  LineCounts counts{};
  std::int64_t accepted_wrong_count = 0;
  std::int64_t accepted_stale_count = 0;
  TimeNs resync_max_ns = 0;
  std::int64_t starts_accepted_count = 0;
  std::optional<ClientLoss> loss = {};
  std::vector<Restart> restarts;  // after t = 0, in order
  // Blocks of the chip that its firmware uses and the emulated board does not model, in the order of their first use.
  std::optional<std::vector<std::string>> unmodelled_blocks;  // absent: none
  std::optional<std::vector<StackUse>>
      stacks;  // of its image, in the order of their addresses; absent: none measured
  std::optional<std::int64_t> failsafe_entered_count;  // absent when the client cannot say
  std::optional<std::int64_t> receive_overruns_count;  // bytes lost by its receiver; absent as above
  // Computations that ended after their deadline; absent when the client states no computing time.
  std::optional<std::int64_t> deadline_missed_count;
  std::vector<TimeNs> request_times_ns;  // arrival at the server of each accepted sensor request
  // When the client sent its message of each period (link::Protocol::PeriodMessage()), before any fault on the line:
  // a request, or a command where the server sends by itself.
  std::vector<TimeNs> sent_request_times_ns;
  std::vector<TimeNs>
      reply_latency_ns;  // from the last byte of a request to the last byte of its reply at the client
  std::vector<TimeNs> actuator_times_ns;  // arrival at the server of each accepted actuator message
  // From the arrival of a reply's last byte at the client to the arrival there of the actuator message that
  // answers it.
  std::vector<TimeNs> client_round_trip_ns;
  std::optional<ProtocolUse> protocol;  // absent in logs of older programs
  // From its first `start` on, kind by kind, each in order of time. Absent as above.
  std::optional<std::vector<LineMistake>> line_mistakes;
  std::string firmware_log;  // lines "t_s text"
  // For flight.json; the log has a file of its own.
  static constexpr bool kLeavesOutNull = true;
  TILTPROOF_FIELDS(id, counts, accepted_wrong_count, accepted_stale_count, resync_max_ns,
                   starts_accepted_count, failsafe_entered_count, receive_overruns_count,
                   deadline_missed_count, loss, restarts, unmodelled_blocks, stacks, request_times_ns,
                   sent_request_times_ns, reply_latency_ns, actuator_times_ns, client_round_trip_ns, protocol,
                   line_mistakes)
};

// The processor time of a firmware's processes while they kept the harness from being on time.
struct ProcessorUse {
  TimeNs run_ns = 0, elapsed_ns = 0;
  std::int64_t processors_count = 0;  // that the machine has
  std::int64_t processes_max = 0;     // at a time
  friend bool operator==(const ProcessorUse&, const ProcessorUse&) = default;
  TILTPROOF_FIELDS(run_ns, elapsed_ns, processors_count, processes_max)
};

struct RunLog {
  Trace trace;
  EndReason end_reason = EndReason::kCompleted;
  std::string end_text;                     // explanation for the user, for everything but kCompleted
  std::optional<FirmwareEnd> firmware_end;  // none: the firmware did not break, or it is not known how
  TimeNs end_ns = 0;                        // simulation time reached
  // The vehicle's inputs at hover and their limits, in the order of its inputs.
  std::vector<double> hover_input, input_min, input_max;
  std::optional<RedundancyTotals> redundancy;  // none: one client, or an arbiter that chooses nothing

  // One per client of the scenario, in its order.
  std::vector<ClientLog> clients = std::vector<ClientLog>(1);
  // Real time only: in how many control periods the harness's own nodes were later than allowed, and by how
  // much at most.
  std::optional<std::int64_t> harness_overrun_count, harness_late_max_ns;
  // The spans of this lateness, in order; they may overlap. What the firmware missed in them, or shortly after, is not
  // its fault: spans that ended just before t = 0 belong to them (kLatenessReach). In a flight that never started, all
  // times are negative: they count to its end.
  std::vector<LateSpan> harness_late;
  // Real time only: lateness that the firmware's own processes caused, in order. It excuses nothing.
  std::vector<LateSpan> firmware_late;
  std::optional<ProcessorUse> firmware_use;  // then
  // Real time only: when this machine took time from the program that represents the board, in order. It may be less
  // than lateness, but a clock in that program may have lost it.
  std::vector<LateSpan> board_disturbed;

  std::vector<std::int64_t> fault_activation_counts;  // one per fault of the scenario
  std::vector<faults::Activation> activations;        // first kActivationsMax of each fault, in time order
  LinkLog link;
  std::vector<RunEvent> events;
  double wall_s = 0.0;  // only of the flight
  // For flight.json, which also has the clients, the events and the lateness; the rest has files of its own.
  static constexpr bool kLeavesOutNull = true;
  TILTPROOF_FIELDS(end_reason, end_text, firmware_end, end_ns, wall_s, hover_input, input_min, input_max,
                   redundancy, fault_activation_counts, harness_overrun_count, harness_late_max_ns,
                   firmware_use)
};

}  // namespace tiltproof::harness
