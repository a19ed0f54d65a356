// A second reading of the temporal logic, as slow as its definitions: every window is a list of rows, every
// operator a loop over it, and "holds" a flag of its own beside the number. Shares with the product the
// parser's tree, and nothing else.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "harness/score/stl.h"

namespace tiltproof::testing {

// Robustness, and whether it holds: at 0 the number alone does not tell.
struct SlowValue {
  double number = 0.0;
  bool holds = false;
};
struct SlowBounds {
  SlowValue lower, upper;
};

// Rows as the oracle sees them: times in nanoseconds, x_m, roll_rad and active_a by row.
struct SlowTrace {
  std::vector<TimeNs> times_ns;
  std::vector<double> x_m, roll_rad, active_a;
  TimeNs seen_until_ns = 0, planned_end_ns = 0;

  harness::Trace ToTrace() const;
};

// Bounds of the formula's value at the first row.
SlowBounds SlowEvaluate(const harness::stl::Formula& formula, const SlowTrace& trace);

// The curve that a report draws over time (harness/score/stl.h), row by row; none in rows that no window looks at.
struct SlowOverTime {
  harness::stl::OverTimeReading reading{};
  std::vector<std::optional<SlowBounds>> rows;
};
SlowOverTime SlowEvaluateOverTime(const harness::stl::Formula& formula, const SlowTrace& trace);

}  // namespace tiltproof::testing
