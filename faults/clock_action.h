// The action of a clock fault on the clock of a node. Node and mode decide which part carries it out: in real
// time a node of the harness (faults/node_command.h), in lockstep the client (faults/device_command.h).
#pragma once

#include <variant>

#include "link/fields.h"
#include "link/time.h"

namespace tiltproof::faults {

struct DriftClock {
  double ppm = 0.0;  // how much too fast; the time gained stays after the end
  TILTPROOF_FIELDS(ppm)
};
struct JumpClock {
  TimeNs by_ns = 0;  // forward; reverted at the end
  TILTPROOF_FIELDS(by_ns)
};
using ClockAction = std::variant<DriftClock, JumpClock>;

}  // namespace tiltproof::faults
