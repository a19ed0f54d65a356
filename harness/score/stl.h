// Signal temporal logic with quantitative robustness, three-valued, over a sampled trace: the key `stl` of a
// criterion.
//
// docs/criteria.md is the user's text: grammar, signals, scales, what happens at the edges. In short: a
// formula is evaluated at the first row of the trace; windows are closed, relative to the enclosing
// operator's time, and look at the rows inside them (one that falls between two rows looks at the row before
// it); a comparison's margin is divided by the scale of its signals; a comparison that meets NaN counts
// against the formula.
//
//   const auto signals = SignalNames(trace.columns());
//   const stl::Formula f = stl::Parse("always[5,60](position_error_m <= 1.0)", {signals, fault_ids});
//   const stl::Result r = stl::Evaluate(f, trace);
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "harness/formula/formula.h"
#include "harness/run/trace.h"
#include "link/fields.h"
#include "link/time.h"

namespace tiltproof::harness::stl {

// The earliest time at which the formula can be decided, whatever the flight does, when its windows begin and end on
// rows: nested windows add up. Operators without a window look to the planned end. A formula is never decided when that
// time is after the end.
TimeNs EarliestDecision(const Formula& formula, TimeNs planned_end_ns);

enum class Truth : std::uint8_t { kFalse, kUnknown, kTrue };

struct Result {
  Truth truth = Truth::kUnknown;
  // Whatever happens in the rest of the flight, the robustness will lie in [lower, upper]; the two are equal
  // when everything that matters was seen. Infinite when no number bounds it: a formula without comparisons,
  // a NaN, a rest that was not seen. 0 with kTrue means that all comparisons on the edge allow it (<=, >=),
  // with kFalse that one does not (<, >).
  double lower = 0.0, upper = 0.0;
  // The bound that matters: the lower one of a true formula, the upper one of a false formula. For an
  // undecided formula the finite one (of two, the nearer to 0); none when neither is finite.
  std::optional<double> robustness;
  // The row that decided: the earliest violation or witness, otherwise the row with the margin. None when no
  // row matters.
  std::optional<TimeNs> time_ns;
  // The values in that row: "roll_rad = -0.71"; empty when there is no such row or no value (true, 1 < 2).
  std::string evidence;
};

// The trace's end: rows lie on a grid, but a flight may end between two rows.
struct Extent {
  TimeNs seen_until_ns = 0;   // the last row holds up to here
  TimeNs planned_end_ns = 0;  // when the flight should have ended: operators without a window look that far
};

// At the first row of the trace. Without an extent, the flight ended with the last row, as planned. Throws
// std::invalid_argument when the trace lacks a column or its times are broken.
Result Evaluate(const Formula& formula, const Trace& trace, std::optional<Extent> extent = std::nullopt);

// Robustness over time, for reports: of what stands under the outermost `always` or `eventually`, at each row in its
// window. So the lowest (of an `eventually` the highest) of these values is the formula's, unless a constant in a window
// behind the last row decides it. The first one below 0 is where an `always` was violated. `always` in `always`, and
// several of them joined by `and`, are one: each row that any of their windows looks at has the lowest of what they ask
// there. Any other formula is asked as a whole, at each row as if the flight began there.
enum class OverTimeReading : std::uint8_t { kLowest, kHighest, kFromHere };
std::string_view Name(OverTimeReading reading);  // lowest, highest, from_here
constexpr OverTimeReading LastOf(OverTimeReading) { return OverTimeReading::kFromHere; }

struct RowRobustness {
  TimeNs time_ns = 0;
  double lower = 0.0, upper = 0.0;  // bounds as in Result
  TILTPROOF_FIELDS(time_ns, lower, upper)
};

struct OverTime {
  OverTimeReading reading = OverTimeReading::kLowest;
  bool looks_ahead = false;         // a row's value depends on later rows, too
  std::vector<RowRobustness> rows;  // of the trace; those that no window looks at are missing
  TILTPROOF_FIELDS(reading, looks_ahead, rows)
};
OverTime EvaluateOverTime(const Formula& formula, const Trace& trace,
                          std::optional<Extent> extent = std::nullopt);

}  // namespace tiltproof::harness::stl
