// The control periods of a flight in which work was late.
//
//   const LatePeriods late = CountLatePeriods(log.harness_late, log.end_ns, 12 * kNsPerMs);
//   const bool was_late = late.count > 0;
#pragma once

#include <cstdint>
#include <span>

#include "harness/run/run_log.h"

namespace tiltproof::harness {

// So long after lateness its effects may still come: bytes that waited, or a watchdog's reset. Watchdogs of flight
// controllers wait for less. One that waits for longer resets after a long standstill alone, and then no flight is judged.
inline constexpr TimeNs kLatenessReach = 250 * kNsPerMs;

struct LatePeriods {
  std::int64_t count = 0;
  TimeNs longest_ns = 0;  // of the spans
};

// `late`: in the order of the begins. What begins after `end_ns`, or ends before 0, does not count.
LatePeriods CountLatePeriods(std::span<const LateSpan> late, TimeNs end_ns, TimeNs period_ns);

}  // namespace tiltproof::harness
