// Which of the firmware's restarts and requests the scenario's faults account for.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "faults/fault.h"
#include "harness/run/run_log.h"

namespace tiltproof::harness {

// The first that no fault asked for; null when there is none. A fault that asks for a restart
// (FaultType::asks_restart()) does so once: the first restart after its start is its own. `restarts` in order of time.
const Restart* FirstUnaskedRestart(const std::vector<faults::FaultSpec>& faults,
                                   std::span<const Restart> restarts);

// Fewer intervals have no median worth the name.
inline constexpr std::size_t kIntervalsMin = 50;

// From each request to the next, in ascending order: those that no fault on the client's device, clock or node
// touches.
std::vector<TimeNs> UndisturbedIntervals(const std::vector<faults::FaultSpec>& faults,
                                         std::span<const TimeNs> request_times_ns);

}  // namespace tiltproof::harness
