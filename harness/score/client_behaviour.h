// Tells which of the firmware's restarts and requests are due to the scenario's faults.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "faults/fault.h"
#include "harness/run/run_log.h"

namespace tiltproof::harness {

// The first restart that no fault asked for; null when there is none. A fault that asks for a restart
// (FaultType::asks_restart()) does so once: the first restart after its start is attributed to it. `restarts`
// in order of time.
const Restart* FirstUnaskedRestart(const std::vector<faults::FaultSpec>& faults,
                                   std::span<const Restart> restarts);

// The median of fewer intervals says nothing.
inline constexpr std::size_t kIntervalsMin = 50;

struct RequestIntervals {
  std::vector<TimeNs> ns;           // in ascending order
  std::size_t disturbed_count = 0;  // by this machine, and left out
};

// Intervals from each request to the next, without those that a fault on the client's device, clock or node
// touches, and those that one of `disturbed` does: spans in the order of their begins.
RequestIntervals UndisturbedIntervals(const std::vector<faults::FaultSpec>& faults,
                                      std::span<const LateSpan> disturbed,
                                      std::span<const TimeNs> request_times_ns);

}  // namespace tiltproof::harness
