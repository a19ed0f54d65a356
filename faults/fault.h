// A fault is data in a scenario, and one small class in faults/models/<layer>/ that edits what passes.
//
// A fault on the wire edits a list of timed chunks, so drop, duplicate, delay, reorder, flip and truncate
// have the same form. A fault on sensors or actuators edits the values. A fault of the firmware's receiver
// marks bytes. A fault on a node or on the device edits nothing: it is a command that other parts carry out
// (faults/node_command.h, faults/device_command.h). No fault knows the plant or the harness. Randomness comes
// from a stream that belongs only to the fault (faults/random.h): adding or removing a fault never shifts
// another's draws.
//
// Order on the wire: frame faults (on frames as sent), then byte and bit faults, then timing faults; within a
// layer in file order.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "faults/parameters.h"
#include "link/chunk.h"
#include "link/fields.h"
#include "link/time.h"

namespace tiltproof::faults {

enum class Target : std::uint8_t { kNone, kToClient, kToPlant, kBoth, kReference };
std::string_view Name(Target target);

// With `when`: how the condition makes the fault active.
enum class Edge : std::uint8_t {
  kLevel,   // while the condition holds
  kRising,  // from where the condition turns true within the window, to the window's end
};
std::string_view Name(Edge edge);

// The window opens `delay_ns` after another fault's first activation.
struct After {
  std::string fault;  // its id
  TimeNs delay_ns = 0;
  friend bool operator==(const After&, const After&) = default;
};

// A fault as the scenario states it. The registry's Validate() does all checks (known type, parameters in
// range, target that the type accepts); the scenario reader adds places in the file.
struct FaultSpec {
  std::string id;    // unique in the scenario; names the random stream
  std::string type;  // "wire.bit_error"
  Target target = Target::kNone;
  std::string client;  // its line, samples or board; empty: those of every client, each with its own draws
  // Id of a line between boards, on which it acts in place of the clients' lines. `target` is then kBoth, or kToClient towards
  // the first of the line's two ends, kToPlant towards the second; kNone: there is no such line. `line_end`: the client
  // at that end; empty: both ways.
  std::string line = {}, line_end = {};
  TimeNs start_ns =
      kPowerOn;  // [start, end): for a frame, when its first byte enters the wire; otherwise the sample's time
  TimeNs end_ns = kNever;
  TimeNs period_ns = kNever;   // with `duty`: active in the first part of each period, counted from start_ns;
  std::optional<double> duty;  // kNever: throughout the window. duty in (0, 1]
  std::string when;            // a condition on the flight's rows, with `edge`; empty: none
  Edge edge = Edge::kLevel;
  std::optional<After> after;
  std::int64_t every_nth_count = 1;  // of the frames or samples in the window, number n, 2n, ...
  double probability = 1.0;          // then with this probability
  std::string
      message;  // the fault sees frames of this message of the protocol only; empty: all (FindMessage())
  std::map<std::string, ParameterValue> parameters;  // by name
};

// As scenarios write it: "to_plant", "cross", "cross_to_a".
std::string TargetText(const FaultSpec& spec);

// True if its activity also depends on other events (faults/fault_event.h), not only on the clock.
inline bool WaitsForEvent(const FaultSpec& spec) { return !spec.when.empty() || spec.after.has_value(); }

// One occasion on which a fault acted. On a line it has boot time, in the log of a flight simulation time.
template <class Time>
struct TimedActivation {
  Time time_ns{};
  std::size_t fault = 0;  // index in the scenario's list
  std::string what;       // "3 bits flipped", "dropped", "x_m 1.25 -> 1.75"
  // Wire faults: the frame before, and everything that went on in its place (chunks with times).
  std::vector<link::TimedChunk<Time>> before, after;
  TILTPROOF_FIELDS(time_ns, fault, what, before, after)
};
using Activation = TimedActivation<TimeNs>;
using BootActivation = TimedActivation<BootTime>;

}  // namespace tiltproof::faults
