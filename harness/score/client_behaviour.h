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

// Intervals from each request to the next, in ascending order, without those that a fault on the client's
// device, clock or node touches.
std::vector<TimeNs> UndisturbedIntervals(const std::vector<faults::FaultSpec>& faults,
                                         std::span<const TimeNs> request_times_ns);

}  // namespace tiltproof::harness
