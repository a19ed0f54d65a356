// What a clock fault does to the clock of a node. Who carries it out follows from node and mode: a node of the harness
// in real time (faults/node_command.h), the client in lockstep (faults/device_command.h).
#pragma once

#include <variant>

#include "link/time.h"

namespace tiltproof::faults {

struct DriftClock {
  double ppm = 0.0;  // how much too fast; what it gains it keeps
};
struct JumpClock {
  TimeNs by_ns = 0;  // forward; taken back at the end
};
using ClockAction = std::variant<DriftClock, JumpClock>;

}  // namespace tiltproof::faults
