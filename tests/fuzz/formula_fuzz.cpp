// Formulas of criteria (signal temporal logic) and conditions of faults: any text is a formula or an error with its
// column; a formula's canonical text is parsed to the same text; its robustness over a small trace keeps its order.
//
// Input: the formula.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "harness/formula/condition.h"
#include "harness/score/stl.h"
#include "tests/fuzz/fuzz_target.h"

namespace {

using namespace tiltproof::harness;
using tiltproof::testing::Require;

const std::vector<std::string>& Signals() {
  static const std::vector<std::string> signals = {"x_m", "vx_m_s", "roll_rad", "active_noise"};
  return signals;
}

// One second: a ramp, a wave, a value that is missing, and a fault.
Trace MakeTrace() {
  Trace trace({"t_s", "x_m", "vx_m_s", "roll_rad", "active_noise"});
  for (int row = 0; row <= 83; ++row) {
    const double t_s = 0.012 * row;
    const auto values = trace.AppendRow();
    const std::array<double, 5> content = {
        t_s, t_s - 0.5, row % 7 * 0.1,
        row == 40 ? std::numeric_limits<double>::quiet_NaN() : 0.01 * (row % 3),
        row > 20 && row < 30 ? 1.0 : 0.0};
    std::copy(content.begin(), content.end(), values.begin());
  }
  return trace;
}

void Check(const stl::Formula& formula) {
  static const Trace trace = MakeTrace();
  constexpr tiltproof::TimeNs kSecond = tiltproof::kNsPerS;
  Require(stl::EarliestDecision(formula, kSecond) >= 0, "a decision has a time");
  for (const tiltproof::TimeNs planned_end : {kSecond, 2 * kSecond}) {
    const stl::Extent extent{.seen_until_ns = kSecond, .planned_end_ns = planned_end};
    const stl::Result result = stl::Evaluate(formula, trace, extent);
    Require(result.lower <= result.upper, "bounds are in order");
    Require(result.truth != stl::Truth::kTrue || result.lower >= 0, "what is true is not below 0");
    Require(result.truth != stl::Truth::kFalse || result.upper <= 0, "what is false is not above 0");
    const stl::OverTime over_time = stl::EvaluateOverTime(formula, trace, extent);
    if (over_time.rows.empty()) continue;
    double lowest_upper = over_time.rows.front().upper, highest_lower = over_time.rows.front().lower;
    for (const stl::RowRobustness& row : over_time.rows) {
      lowest_upper = std::min(lowest_upper, row.upper);
      highest_lower = std::max(highest_lower, row.lower);
    }
    switch (over_time.reading) {
      case stl::OverTimeReading::kLowest:
        Require(lowest_upper == result.upper, "the lowest over time is the result");
        break;
      case stl::OverTimeReading::kHighest:
        Require(highest_lower == result.lower, "the highest over time is the result");
        break;
      case stl::OverTimeReading::kFromHere:
        Require(over_time.rows.size() == trace.row_count(), "each row has its robustness");
        Require(over_time.rows.front().lower == result.lower && over_time.rows.front().upper == result.upper,
                "the first row is the result");
    }
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(data, data + size);
  const std::vector<std::string> fault_ids = {"noise"};
  const stl::Vocabulary vocabulary{.signals = Signals(), .fault_ids = fault_ids};
  try {
    const stl::Formula formula = stl::Parse(text, vocabulary);
    const std::string canonical = stl::ToString(formula);
    // It has all parentheses, so it may be longer than what may be written.
    if (canonical.size() <= stl::kFormulaLengthMax_bytes) {
      try {
        Require(stl::ToString(stl::Parse(canonical, vocabulary)) == canonical, "canonical text stays");
      } catch (const stl::ParseError& error) {
        Require(std::string(error.what()).find("nested") != std::string::npos,
                "canonical text can be parsed");
      }
    }
    Check(formula);
  } catch (const stl::ParseError& error) {
    Require(error.column >= 1 && error.column <= text.size() + 1, "an error is in the text, or at its end");
  }
  try {
    const stl::Condition condition(text, Signals());
    condition.Holds([](std::string_view) { return 0.25; });
    Require(condition.Signals().size() <= Signals().size(), "each signal is named once");
  } catch (const stl::ParseError&) {
  }
  return 0;
}
