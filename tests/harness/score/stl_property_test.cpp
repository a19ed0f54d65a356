// The monitor against the slow oracle, and against itself on flights that go on.
#include <gtest/gtest.h>
// rapidcheck needs GoogleTest's macros.
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <string>

#include "harness/score/stl.h"
#include "tests/harness/score/stl_oracle.h"
#include "tests/support/control_period.h"
#include "tests/support/tiltrotor_signals.h"

namespace tiltproof::testing {
namespace {

namespace stl = harness::stl;

const std::vector<std::string> kOneFault = {"a"};

// 0 .. count - 1, all alike however far the run is (rapidcheck starts small).
int Choose(int count) { return *rc::gen::resize(rc::kNominalSize, rc::gen::inRange(0, count)); }

std::string RandomNumber(int depth) {
  const int kind = Choose(depth > 0 ? 9 : 4);
  switch (kind) {
    case 0:
      return "x_m";
    case 1:
      return "roll_rad";
    case 2:
      return std::to_string(Choose(3));
    case 3:
      return "0.5";
    case 4:
      return "-" + RandomNumber(depth - 1);
    case 5:
      return "abs(" + RandomNumber(depth - 1) + ")";
    case 6:
      return "min(" + RandomNumber(depth - 1) + ", " + RandomNumber(depth - 1) + ")";
    case 7:
      return "max(" + RandomNumber(depth - 1) + "," + RandomNumber(depth - 1) + ")";
    default:
      return "(" + RandomNumber(depth - 1) + (*rc::gen::arbitrary<bool>() ? " + " : "-") +
             RandomNumber(depth - 1) + ")";
  }
}

// On rows, between rows, across the end, of no length.
std::string RandomWindow() {
  const int begin_ms = *rc::gen::element(0, 0, 1, 6, 12, 24, 30, 60);
  const int length_ms = *rc::gen::element(0, 0, 1, 11, 12, 13, 30, 48, 200);
  return "[" + std::to_string(begin_ms) + "e-3," + std::to_string(begin_ms + length_ms) + "e-3]";
}

std::string RandomFormula(int depth) {
  const int kind = depth > 0 ? 4 + Choose(10) : Choose(5);
  const auto inside = [&] { return RandomFormula(depth - 1); };
  switch (kind) {
    case 0:
    case 1:
    case 2:
    case 3:
      return RandomNumber(2) + " " + *rc::gen::element<std::string>("<", "<=", ">", ">=") + " " +
             RandomNumber(1);
    case 4:
      return *rc::gen::element<std::string>("true", "false", "fault_active(\"a\")", "fault_active(\"a\")");
    case 5:
      return "not (" + inside() + ")";
    case 6:
      return "(" + inside() + ") and (" + inside() + ")";
    case 7:
      return "(" + inside() + ") or (" + inside() + ")";
    case 8:
      return "(" + inside() + ") implies (" + inside() + ")";
    case 9:
      return "always(" + inside() + ")";
    case 10:
      return "eventually(" + inside() + ")";
    case 11:
      return "always" + RandomWindow() + "(" + inside() + ")";
    case 12:
      return "eventually" + RandomWindow() + "(" + inside() + ")";
    default:
      return "(" + inside() + ") until" + RandomWindow() + " (" + inside() + ")";
  }
}

// Few different values, so that equal ones and margins of 0 are common; now and then NaN.
double RandomValue() {
  return *rc::gen::element(-1.0, -0.5, 0.0, 0.0, 0.5, 1.0, 1.0, 2.0, 3.0,
                           std::numeric_limits<double>::quiet_NaN());
}

void AppendRows(SlowTrace& trace, int count) {
  for (int i = 0; i < count; ++i) {
    const bool first = trace.times_ns.empty();
    trace.times_ns.push_back(first ? 0 : trace.times_ns.back() + kControlPeriodNs);
    trace.x_m.push_back(RandomValue());
    trace.roll_rad.push_back(RandomValue());
    trace.active_a.push_back(*rc::gen::element(0.0, 0.0, 1.0, std::numeric_limits<double>::quiet_NaN()));
  }
}

// As many rows as wished, the last perhaps off the grid; the plan ends with it or later.
SlowTrace RandomTrace() {
  SlowTrace trace;
  AppendRows(trace, 1 + Choose(8));
  if (trace.times_ns.size() > 1) trace.times_ns.back() -= *rc::gen::element(0, 0, 5) * kNsPerMs;
  trace.seen_until_ns = trace.times_ns.back() + *rc::gen::element(0, 0, 0, 4, 11) * kNsPerMs;
  trace.planned_end_ns = trace.seen_until_ns + *rc::gen::element(0, 0, 7, 12, 60) * kNsPerMs;
  return trace;
}

stl::Result Judge(const stl::Formula& formula, const SlowTrace& trace) {
  return stl::Evaluate(formula, trace.ToTrace(), stl::Extent{trace.seen_until_ns, trace.planned_end_ns});
}

stl::Truth TruthOf(const SlowBounds& bounds) {
  if (bounds.lower.holds) return stl::Truth::kTrue;
  return bounds.upper.holds ? stl::Truth::kUnknown : stl::Truth::kFalse;
}

RC_GTEST_PROP(StlMonitor, AgreesWithTheDefinitions, ()) {
  const std::string text = RandomFormula(Choose(4));
  const SlowTrace trace = RandomTrace();
  RC_LOG() << text << "\n";
  const stl::Formula formula = testing::ParseCriterion(text, kOneFault);
  const SlowBounds expected = SlowEvaluate(formula, trace);
  const stl::Result result = Judge(formula, trace);
  RC_CLASSIFY(result.truth == stl::Truth::kTrue, "true");
  RC_CLASSIFY(result.truth == stl::Truth::kFalse, "false");
  RC_CLASSIFY(result.truth == stl::Truth::kUnknown, "unknown");
  RC_ASSERT(result.truth == TruthOf(expected));
  RC_ASSERT(result.lower == expected.lower.number);
  RC_ASSERT(result.upper == expected.upper.number);
}

stl::OverTime Watch(const stl::Formula& formula, const SlowTrace& trace) {
  return stl::EvaluateOverTime(formula, trace.ToTrace(),
                               stl::Extent{trace.seen_until_ns, trace.planned_end_ns});
}

RC_GTEST_PROP(StlMonitor, OverTimeItAgreesWithTheDefinitionsToo, ()) {
  const std::string text = RandomFormula(Choose(4));
  const SlowTrace trace = RandomTrace();
  RC_LOG() << text << "\n";
  const stl::Formula formula = testing::ParseCriterion(text, kOneFault);
  const SlowOverTime expected = SlowEvaluateOverTime(formula, trace);
  const stl::OverTime result = Watch(formula, trace);
  RC_CLASSIFY(result.reading == stl::OverTimeReading::kLowest, "lowest");
  RC_CLASSIFY(result.reading == stl::OverTimeReading::kHighest, "highest");
  RC_CLASSIFY(result.reading == stl::OverTimeReading::kFromHere, "from here");
  RC_ASSERT(result.reading == expected.reading);
  std::size_t i = 0;
  for (std::size_t r = 0; r < trace.times_ns.size(); ++r) {
    if (!expected.rows[r]) continue;
    RC_ASSERT(i < result.rows.size());
    RC_ASSERT(result.rows[i].time_ns == trace.times_ns[r]);
    RC_ASSERT(result.rows[i].lower == expected.rows[r]->lower.number);
    RC_ASSERT(result.rows[i].upper == expected.rows[r]->upper.number);
    ++i;
  }
  RC_ASSERT(i == result.rows.size());
}

// Readers of the curve take for granted that its extreme is the margin that decided the criterion.
RC_GTEST_PROP(StlMonitor, TheExtremeOverTimeIsTheMargin, ()) {
  const std::string text = RandomFormula(Choose(4));
  SlowTrace trace = RandomTrace();
  RC_LOG() << text << "\n";
  const stl::Formula formula = testing::ParseCriterion(text, kOneFault);
  const stl::OverTime over_time = Watch(formula, trace);
  if (over_time.reading == stl::OverTimeReading::kFromHere) {
    RC_ASSERT(over_time.rows.size() == trace.times_ns.size());
    return;
  }
  const bool lowest = over_time.reading == stl::OverTimeReading::kLowest;
  const stl::Result result = Judge(formula, trace);
  double extreme =
      lowest ? std::numeric_limits<double>::infinity() : -std::numeric_limits<double>::infinity();
  for (const stl::RowRobustness& row : over_time.rows)
    extreme = lowest ? std::min(extreme, row.upper) : std::max(extreme, row.lower);
  RC_CLASSIFY(result.truth != stl::Truth::kUnknown, "decided");
  RC_ASSERT(over_time.rows.empty() || extreme == (lowest ? result.upper : result.lower));
}

// Whatever a flight that was cut short would have done next: what was decided stays decided, and the bounds
// only close in.
RC_GTEST_PROP(StlMonitor, WhatIsDecidedNoContinuationChanges, ()) {
  const std::string text = RandomFormula(Choose(4));
  RC_LOG() << text << "\n";
  const stl::Formula formula = testing::ParseCriterion(text, kOneFault);
  SlowTrace trace;
  AppendRows(trace, 1 + Choose(5));
  const int rest = 1 + Choose(5);
  trace.seen_until_ns = trace.times_ns.back() + *rc::gen::element(0, 5) * kNsPerMs;
  trace.planned_end_ns = trace.times_ns.back() + rest * kControlPeriodNs;
  stl::Result seen = Judge(formula, trace);
  for (int i = 0; i < rest; ++i) {
    AppendRows(trace, 1);
    trace.seen_until_ns = trace.times_ns.back();
    const stl::Result more = Judge(formula, trace);
    RC_ASSERT(more.lower >= seen.lower);
    RC_ASSERT(more.upper <= seen.upper);
    if (seen.truth != stl::Truth::kUnknown) RC_ASSERT(more.truth == seen.truth);
    seen = more;
  }
}

// With windows that begin and end on rows. Where an end lies between two rows, the row before it is the last.
std::string WithWindowsOnRows(std::string text) {
  constexpr int kPeriod_ms = kControlPeriodNs / kNsPerMs;
  for (std::size_t at = text.find('['); at != text.npos; at = text.find('[', at + 1)) {
    int begin_ms = 0, end_ms = 0;
    std::sscanf(text.c_str() + at, "[%de-3,%de-3]", &begin_ms, &end_ms);
    begin_ms = (begin_ms + kPeriod_ms - 1) / kPeriod_ms * kPeriod_ms;
    end_ms = std::max(begin_ms, end_ms / kPeriod_ms * kPeriod_ms);
    text.replace(at, text.find(']', at) - at,
                 "[" + std::to_string(begin_ms) + "e-3," + std::to_string(end_ms) + "e-3");
  }
  return text;
}

// No formula is decided earlier than a formula of its form can be.
RC_GTEST_PROP(StlHorizon, NothingIsDecidedBeforeItCanBe, ()) {
  const std::string text = WithWindowsOnRows(RandomFormula(Choose(4)));
  RC_LOG() << text << "\n";
  const stl::Formula formula = testing::ParseCriterion(text, kOneFault);
  const SlowTrace trace = RandomTrace();
  RC_PRE(trace.times_ns.back() % kControlPeriodNs == 0);
  const bool decided = Judge(formula, trace).truth != stl::Truth::kUnknown;
  RC_CLASSIFY(decided, "decided");
  if (decided) RC_ASSERT(stl::EarliestDecision(formula, trace.planned_end_ns) <= trace.seen_until_ns);
}

// A NaN may break a criterion or leave it undecided, never help it: whatever number stood in its place could
// only do better.
RC_GTEST_PROP(StlMonitor, ANanNeverHelps, ()) {
  const std::string text = RandomFormula(Choose(4));
  RC_LOG() << text << "\n";
  const stl::Formula formula = testing::ParseCriterion(text, kOneFault);
  SlowTrace trace = RandomTrace();
  const stl::Result with_nan = Judge(formula, trace);
  for (auto* values : {&trace.x_m, &trace.roll_rad, &trace.active_a})
    for (double& value : *values)
      if (std::isnan(value)) value = *rc::gen::element(-2.0, 0.0, 1.0, 5.0);
  const stl::Result without = Judge(formula, trace);
  RC_ASSERT(with_nan.lower <= without.lower);
  RC_ASSERT(with_nan.upper <= without.upper);
  if (with_nan.truth == stl::Truth::kTrue) RC_ASSERT(without.truth == stl::Truth::kTrue);
}

RC_GTEST_PROP(StlParser, PrintedFormulasReadBackTheSame, ()) {
  const std::string text = RandomFormula(Choose(5));
  const std::string printed = stl::ToString(testing::ParseCriterion(text, kOneFault));
  RC_ASSERT(stl::ToString(testing::ParseCriterion(printed, kOneFault)) == printed);
}

// Pieces that are nearly a formula reach further into the parser than bytes at random.
RC_GTEST_PROP(StlParser, NonsenseIsRefusedWithAPlace, ()) {
  const auto piece = rc::gen::oneOf(
      rc::gen::element<std::string>("always", "eventually", "until", "not", "and", "or", "implies", "true",
                                    "abs", "min(", "x_m", "roll_rad", "<=", ">", "(", ")", "[", "]", ",", "+",
                                    "-", "*", "/", "1", "2.5e3", "1e999", ".", "\"a\"", "\"", "fault_active(",
                                    " ", "[0,1](", "x_m <= 1"),
      rc::gen::container<std::string>(rc::gen::arbitrary<char>()));
  const auto pieces = *rc::gen::container<std::vector<std::string>>(piece);
  std::string text;
  for (const auto& p : pieces) text += p;
  try {
    RC_ASSERT(testing::ParseCriterion(text, kOneFault) != nullptr);
  } catch (const stl::ParseError& error) {
    RC_ASSERT(error.column >= 1u);
    RC_ASSERT(error.column <= text.size() + 1);
    RC_ASSERT(!std::string(error.what()).empty());
  }
}

}  // namespace
}  // namespace tiltproof::testing
