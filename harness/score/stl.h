// Signal temporal logic with quantitative robustness, three-valued, over a sampled trace: the `stl` of a
// criterion.
//
// docs/criteria.md is the user's text: grammar, signals, scales, what happens at the edges. In short: a
// formula is evaluated at the first row of the trace; windows are closed, relative to the enclosing
// operator's time, and look at the rows inside them (one that falls between two rows looks at the row before
// it); a comparison's margin is divided by the scale of its signals; a comparison that meets NaN counts
// against the formula.
//
//   const stl::Formula f = stl::Parse("always[5,60](position_error_m <= 1.0)", fault_ids);
//   const stl::Result r = stl::Evaluate(f, trace, duration_ns);
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>

#include "harness/run/trace.h"
#include "link/time.h"

namespace tiltproof::harness::stl {

// 1-based column in the formula's text, in bytes.
struct ParseError : std::runtime_error {
  ParseError(std::size_t column_in, const std::string& message)
      : std::runtime_error(message), column(column_in) {}
  std::size_t column;
};

// clang-format off
enum class Op : std::uint8_t {
  // Numbers.
  kNumber, kSignal, kNegate, kAbs, kMin, kMax, kAdd, kSubtract, kMultiply, kDivide,
  // Comparisons of numbers.
  kLessEqual, kLess, kGreaterEqual, kGreater,
  // Formulas.
  kTrue, kFalse, kFaultActive, kNot, kAnd, kOr, kImplies, kAlways, kEventually, kUntil,
};
// clang-format on

struct Node;
using Formula = std::shared_ptr<const Node>;

// Closed, relative to the enclosing operator's time, 0 <= begin_ns <= end_ns.
struct Window {
  TimeNs begin_ns = 0, end_ns = 0;
};

struct Node {
  Op op{};
  double number = 0.0;  // kNumber
  std::string name{};   // kSignal: of the signal; kFaultActive: the fault's id
  // kUntil has one; kAlways and kEventually without look to the end of the flight.
  std::optional<Window> window{};
  Formula left{}, right{};  // an operator of one operand has it on the left
};

inline constexpr std::size_t kFormulaLengthMax_bytes = 4096;
inline constexpr std::size_t kNestingMax_count = 64;
inline constexpr double kWindowMax_s = 1e6;

// Throws ParseError. `fault_ids`: what fault_active("...") may name.
Formula Parse(std::string_view text, std::span<const std::string> fault_ids);

// Canonical text, with all parentheses: Parse(ToString(f)) has the same text.
std::string ToString(const Formula& formula);

// When the formula can be decided at the earliest, whatever the flight does: nested windows add up. Operators
// without a window look to the planned end. It is never decided when that is after the end.
TimeNs EarliestDecision(const Formula& formula, TimeNs planned_end_ns);

enum class Truth : std::uint8_t { kFalse, kUnknown, kTrue };

struct Result {
  Truth truth = Truth::kUnknown;
  // However the rest of the flight may go, the robustness will lie in [lower, upper]; equal when all that
  // matters was seen. Infinite when no number bounds it: a formula without comparisons, a NaN, a rest that
  // was not seen. 0 with kTrue means that all comparisons on the edge allow it (<=, >=), with kFalse that one
  // does not (<, >).
  double lower = 0.0, upper = 0.0;
  // The one that matters: the lower bound of what is true, the upper bound of what is false; of the undecided
  // the finite one (the nearer to 0 of two), none when neither is.
  std::optional<double> robustness;
  // The row that decided: the earliest violation or witness, else the one with the margin. None when no row
  // matters.
  std::optional<TimeNs> time_ns;
  // What that row says: "roll_rad = -0.71"; empty when there is no such row or it has nothing to say (true, 1
  // < 2).
  std::string evidence;
};

// How far the trace goes: rows lie on a grid, flights end where they end.
struct Extent {
  TimeNs seen_until_ns = 0;   // the last row still tells up to here; what is before it counts as it
  TimeNs planned_end_ns = 0;  // when the flight should have ended: operators without a window look that far
};

// At the first row of the trace. Without an extent, the flight ended with the last row, as planned. Throws
// std::invalid_argument when the trace lacks a column or its times are broken.
Result Evaluate(const Formula& formula, const Trace& trace, std::optional<Extent> extent = std::nullopt);

}  // namespace tiltproof::harness::stl
