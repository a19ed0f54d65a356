// Orders to a node to do something to itself: the faults on nodes that no signal to a process can cause.
//
//   commands.Write(ToMessage(LeaveBus{.duration_ns = 2 * kNsPerS}));
//   if (const auto order = FromMessage(message)) std::visit(Overloaded{...}, *order);
#pragma once

#include <optional>
#include <variant>

#include "harness/dds/messages.h"
#include "link/time.h"

namespace tiltproof::harness {

struct LeaveBus {
  TimeNs duration_ns = 0;
};
// From now on the clock runs `ppm` too fast.
struct SetClockRate {
  double ppm = 0.0;
};
struct JumpClock {
  TimeNs by_ns = 0;  // forward
};
using NodeOrder = std::variant<LeaveBus, SetClockRate, JumpClock>;

// The sender fills in run, node, sequence and fault.
dds::FaultCommand ToMessage(const NodeOrder& order);
// None when the message contains no order that a node can carry out, or exceeds what a fault allows.
std::optional<NodeOrder> FromMessage(const dds::FaultCommand& message);

}  // namespace tiltproof::harness
