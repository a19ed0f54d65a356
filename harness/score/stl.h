// Signal temporal logic with quantitative robustness, three-valued, over a sampled trace: the `stl` of a criterion.
//
// Grammar and semantics are those of the scenario contract, restated in docs/criteria.md. Robustness is the usual min/max one; the
// margin of a comparison is divided by the scale of its signals' unit; NaN counts as minus infinity.
//
//   stl::Formula f = stl::Parse("always[5,60](position_error_m <= 1.0)", signals);    // throws stl::ParseError with column
//   stl::Result r = stl::Evaluate(f, trace);
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "harness/run/trace.h"

namespace tiltproof::harness::stl {

// 1-based column in the formula's text.
struct ParseError : std::runtime_error {
  ParseError(std::size_t column_in, const std::string& message) : std::runtime_error(message), column(column_in) {}
  std::size_t column;
};

struct Node;
using Formula = std::shared_ptr<const Node>;

// `fault_ids`: what fault_active("...") may name.
Formula Parse(std::string_view text, std::span<const std::string> fault_ids);

enum class Truth { kFalse, kUnknown, kTrue };
struct Result {
  Truth truth = Truth::kUnknown;
  double robustness = 0.0;       // of what was seen; > 0 when kTrue, < 0 (or 0 for a strict comparison) when kFalse
  std::optional<double> time_s;  // when the deciding sample was taken
};
// At t = 0 of the trace.
Result Evaluate(const Formula& formula, const Trace& trace);

// The signals a formula may use: every numeric trace column, and position_error_m, cross_track_error_m, speed_m_s, tilt_rad.
std::vector<std::string> SignalNames();

}  // namespace tiltproof::harness::stl
