// Tells which of the firmware's restarts and requests are due to the scenario's faults, and to this machine.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "faults/fault.h"
#include "harness/run/run_log.h"
#include "harness/scenario/scenario.h"

namespace tiltproof::harness {

// Those that act on this client, for all that a client may be asked.
std::vector<faults::FaultSpec> FaultsOn(const Scenario& scenario, std::size_t client);

// The begin of a sentence about one of several clients.
std::string Whose(const Scenario& scenario, std::size_t client);

// Arrivals at the server of the client's message of each period (link::Protocol::PeriodMessage()).
const std::vector<TimeNs>& PeriodTimes(const Scenario& scenario, const ClientLog& log);

// The restarts that no fault asked for, in order. A fault that asks for a restart (FaultType::asks_restart())
// does so once: the first restart after its start is attributed to it. `restarts` in order of time.
std::vector<Restart> UnaskedRestarts(const std::vector<faults::FaultSpec>& faults,
                                     std::span<const Restart> restarts);

// True if this machine took time from the flight (RunLog::harness_late) directly before a restart: a watchdog
// may have seen that, and not the firmware.
bool FollowsLateness(const Restart& restart, std::span<const LateSpan> late);

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
