// The moment of no return of a flight that failed: at which time its end was decided. Pure: it asks for futures, and
// flies none.
//
//   const auto evaluate = [](const std::vector<TimeNs>& moments) {
//     std::vector<FutureCount> counts;  // of the futures of each moment: those that fail
//     for (const TimeNs t : moments) counts.push_back({.futures = 1, .fails = t >= 3 * kNsPerS, .drawn = false});
//     return counts;
//   };
//   const NoReturn found = FindNoReturn({.begin_ns = kNsPerS, .end_ns = 5 * kNsPerS, .step_ns = 12 * kNsPerMs}, evaluate);
//   const double lost_s = found.point_of_no_return_s.value();
//
// A coarse grid comes first. Then intervals over which the chance of failing crosses one half are halved down to one step.
// Then, while the chance changes much within an interval, that is halved, too.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

#include "harness/report/why_file.h"
#include "link/time.h"

namespace tiltproof::harness {

// Futures of one moment. `drawn` false: nothing in them is random, so one stands for all.
struct FutureCount {
  std::size_t futures = 0, fails = 0;
  bool drawn = true;
};

struct MomentRange {
  TimeNs begin_ns = 0, end_ns = 0;  // in simulation time; begin_ns <= end_ns
  TimeNs step_ns = 0;               // distance of two moments, at least
  std::size_t moments_max = 40;     // at least 2
};

struct NoReturn {
  std::vector<WhyPoint> curve;  // ascending
  // The last moment at which a flight without faults from there on fails with a chance below 1/2, and the first
  // from which on the chance is 1/2 or more at every moment. None: there is no such moment.
  std::optional<double> last_chance_s, point_of_no_return_s;
};

// `evaluate` returns the futures of each moment, and fewer counts than moments when it is interrupted: the search then
// ends with what it knows.
NoReturn FindNoReturn(const MomentRange& range,
                      const std::function<std::vector<FutureCount>(const std::vector<TimeNs>&)>& evaluate);

}  // namespace tiltproof::harness
