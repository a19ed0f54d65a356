// The language of criteria and of a fault's `when`: numbers, comparisons, logic, and time operators.
//
// docs/criteria.md has the grammar. The caller says which signals and faults exist:
//
//   const Formula f = Parse("always[5,60](position_error_m <= 1.0)", {signals, fault_ids});
//   ToString(f);
//
// harness/score/stl.h evaluates a formula over a whole trace, harness/formula/condition.h one without time operators on
// one row.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>

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
  // kUntil always has one; kAlways and kEventually without one look to the end of the flight.
  std::optional<Window> window{};
  Formula left{}, right{};  // an operator of one operand has it on the left
};

inline constexpr std::size_t kFormulaLengthMax_bytes = 4096;
inline constexpr std::size_t kNestingMax_count = 64;
inline constexpr double kWindowMax_s = 1e6;

// Names that a formula may use. A signal active_<id> belongs to each fault.
struct Vocabulary {
  std::span<const std::string> signals = {};
  std::span<const std::string> fault_ids = {};
  bool of_one_row = false;  // no time operators and no fault_active
  bool any_name = false;    // signals and faults were checked before
};

// A flight's trace has one column of this prefix for each fault, 0 or 1.
inline constexpr std::string_view kActivePrefix = "active_";

// Throws ParseError.
Formula Parse(std::string_view text, const Vocabulary& vocabulary);

// Canonical text, with all parentheses: Parse(ToString(f)) has the same text.
std::string ToString(const Formula& formula);

// The X of `always(X)` or `always[a,b](X)`, when X has no time operators; otherwise null.
Formula BodyOfAlways(const Formula& formula);

// The value of an operator on numbers; NaN when an operand is NaN.
double Apply(Op op, double left, double right);
bool IsComparison(Op op);

}  // namespace tiltproof::harness::stl
