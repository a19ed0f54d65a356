// Meaning of a formula's text, example by example; the property tests cover the rest.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "harness/score/sliding_fold.h"
#include "harness/score/stl.h"
#include "tests/harness/score/still_flight.h"
#include "tests/support/control_period.h"
#include "tests/support/tiltrotor_signals.h"

namespace tiltproof::harness::stl {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
const std::vector<std::string> kFaults = {"a"};

// Rows every 12 ms with x_m and roll_rad as given (roll 0 where there are too few).
Trace MakeTrace(const std::vector<double>& x_m, const std::vector<double>& roll_rad = {}) {
  Trace trace({"t_s", "x_m", "roll_rad", "active_a"});
  for (std::size_t r = 0; r < x_m.size(); ++r) {
    const auto row = trace.AppendRow();
    row[0] = ToSeconds(static_cast<TimeNs>(r) * kControlPeriodNs);
    row[1] = x_m[r];
    row[2] = r < roll_rad.size() ? roll_rad[r] : 0.0;
    row[3] = 0.0;
  }
  return trace;
}

Result Judge(const std::string& text, const Trace& trace,
             std::optional<TimeNs> planned_end_ns = std::nullopt) {
  if (!planned_end_ns) return Evaluate(testing::ParseCriterion(text, kFaults), trace);
  return Evaluate(testing::ParseCriterion(text, kFaults), trace, Extent{0, *planned_end_ns});
}
Truth TruthOf(const std::string& text, const Trace& trace,
              std::optional<TimeNs> planned_end_ns = std::nullopt) {
  return Judge(text, trace, planned_end_ns).truth;
}

double EarliestDecision_s(const std::string& text) {
  return ToSeconds(EarliestDecision(testing::ParseCriterion(text, kFaults), FromSeconds(60)));
}

TEST(StlHorizon, NestedWindowsAddUp) {
  EXPECT_EQ(EarliestDecision_s("x_m < 1"), 0);
  EXPECT_EQ(EarliestDecision_s("always[5,90](x_m < 1)"), 5) << "the first row may violate it";
  EXPECT_EQ(EarliestDecision_s("eventually[70,90](x_m < 1)"), 70) << "the first row may be a witness";
  EXPECT_EQ(EarliestDecision_s("always[0,30](eventually[40,50](x_m < 1))"), 50)
      << "a violation, before 30 + 40";
  EXPECT_EQ(EarliestDecision_s("always[40,50](always[30,35](x_m < 1))"), 70);
  EXPECT_EQ(EarliestDecision_s("eventually[40,50](not always[30,35](x_m < 1))"), 70);
  EXPECT_EQ(EarliestDecision_s("always(x_m < 1)"), 0);
  EXPECT_EQ(EarliestDecision_s("always[70,80](true and 1 < 2)"), 0);
  EXPECT_EQ(EarliestDecision_s("eventually[70,71](x_m < 1) and x_m < 1"), 0);
  EXPECT_EQ(EarliestDecision_s("eventually[70,71](x_m < 1) and always[80,81](x_m < 1)"), 71);
  EXPECT_EQ(EarliestDecision_s("eventually[70,71](x_m < 1) implies always[80,81](x_m < 1)"), 71);
  EXPECT_EQ(EarliestDecision_s("(x_m < 1) until[70,80] (x_m > 2)"), 0);
}

TEST(StlMonitor, ComparisonsAtTheirEdge) {
  const Trace trace = MakeTrace({1.0});
  EXPECT_EQ(TruthOf("x_m <= 1", trace), Truth::kTrue);
  EXPECT_EQ(TruthOf("x_m < 1", trace), Truth::kFalse);
  EXPECT_EQ(TruthOf("x_m >= 1", trace), Truth::kTrue);
  EXPECT_EQ(TruthOf("x_m > 1", trace), Truth::kFalse);
  EXPECT_EQ(TruthOf("not x_m < 1", trace), Truth::kTrue);
  EXPECT_EQ(TruthOf("not x_m <= 1", trace), Truth::kFalse);
  EXPECT_EQ(TruthOf("always(x_m < 1 or x_m <= 1)", trace), Truth::kTrue);
  EXPECT_EQ(TruthOf("always(x_m < 1 and x_m <= 1)", trace), Truth::kFalse);
  const Result result = Judge("x_m < 1", trace);
  EXPECT_EQ(result.robustness, 0.0);
  EXPECT_FALSE(std::signbit(result.robustness.value()));
}

TEST(StlMonitor, MarginsAreInUnitsOfTheSignalsScale) {
  const Trace trace = MakeTrace({3.0}, {0.25});
  EXPECT_EQ(Judge("x_m <= 4", trace).robustness, 1.0);
  EXPECT_EQ(Judge("roll_rad <= 0.5", trace).robustness, 0.5);
  EXPECT_EQ(Judge("0.5 >= abs(-roll_rad)", trace).robustness, 0.5);
  EXPECT_EQ(Judge("roll_rad < x_m", trace).robustness, 2.75);    // the larger scale, 1
  EXPECT_EQ(Judge("2 * roll_rad <= 1", trace).robustness, 0.5);  // as roll_rad <= 0.5
  EXPECT_EQ(Judge("roll_rad / 0.5 <= 1", trace).robustness, 0.5);
  EXPECT_EQ(Judge("roll_rad * roll_rad <= 1", trace).robustness, 0.9375);  // no scale for rad^2
  EXPECT_EQ(Judge("1 / roll_rad <= 5", trace).robustness, 1.0);
  EXPECT_EQ(Judge("0 * roll_rad <= 1", trace).robustness, 1.0);
  EXPECT_EQ(Judge("max(roll_rad, 0.5) - min(0.125, roll_rad) <= 0.5", trace).robustness, 0.25);
  EXPECT_EQ(Judge("1 < 3", trace).robustness, 2.0);
}

TEST(StlMonitor, WindowsAreClosedAndRelative) {
  const Trace trace = MakeTrace({0, 1, 2, 3, 4, 5});
  EXPECT_EQ(Judge("always[0.012,0.036](x_m <= 10)", trace).robustness, 7.0);
  EXPECT_EQ(Judge("eventually[0.012,0.036](x_m <= 10)", trace).robustness, 9.0);
  EXPECT_EQ(Judge("always[0.0121,0.0359](x_m <= 10)", trace).robustness, 8.0);
  EXPECT_EQ(Judge("always[0.012,0.024](eventually[0.012,0.024](x_m >= 0))", trace).robustness, 3.0);
  EXPECT_EQ(Judge("eventually[0,0.012](always[0,0.012](x_m >= 0))", trace).robustness, 1.0);
  EXPECT_EQ(Judge("always(x_m >= -1)", trace).robustness, 1.0);
  EXPECT_EQ(TruthOf("always[0,0.06](x_m >= 0)", trace), Truth::kTrue);
}

TEST(StlMonitor, AWindowBetweenTwoRowsSeesTheOneBefore) {
  const Trace trace = MakeTrace({0, 1, 2, 3});
  EXPECT_EQ(Judge("always[0.001,0.002](x_m >= 0)", trace).robustness, 0.0);
  EXPECT_EQ(Judge("eventually[0.013,0.023](x_m >= 0)", trace).robustness, 1.0);
  // Up to then the left side holds as well, on that row too.
  EXPECT_EQ(Judge("(x_m >= -5) until[0.013,0.023] (x_m >= 0)", trace).robustness, 1.0);
  EXPECT_EQ(TruthOf("(x_m < 1) until[0.013,0.023] (x_m >= 0)", trace), Truth::kFalse);
}

TEST(StlMonitor, UntilNeedsTheLeftSideBeforeTheRightOnly) {
  const Trace trace = MakeTrace({0, 0, 5, 0});
  EXPECT_EQ(Judge("(x_m < 1) until[0,0.036] (x_m > 3)", trace).robustness, 1.0);
  EXPECT_EQ(TruthOf("(x_m < 1) until[0.03,0.036] (x_m < 3)", trace), Truth::kFalse);
  EXPECT_EQ(TruthOf("(false) until[0,0.036] (x_m < 3)", trace), Truth::kTrue);
  EXPECT_EQ(TruthOf("(false) until[0.001,0.036] (x_m < 3)", trace), Truth::kFalse);
}

TEST(StlMonitor, WhatWasSeenDecidesEvenWhenTheFlightEndsEarly) {
  const Trace trace = MakeTrace({0, 1, 2});
  const TimeNs planned_end_ns = 10 * kControlPeriodNs;
  EXPECT_EQ(TruthOf("always(x_m < 2)", trace, planned_end_ns), Truth::kFalse);
  EXPECT_EQ(TruthOf("always(x_m < 3)", trace, planned_end_ns), Truth::kUnknown);
  EXPECT_EQ(TruthOf("always(x_m < 3)", trace), Truth::kTrue);
  EXPECT_EQ(TruthOf("eventually(x_m > 1)", trace, planned_end_ns), Truth::kTrue);
  EXPECT_EQ(TruthOf("eventually(x_m > 2)", trace, planned_end_ns), Truth::kUnknown);
  EXPECT_EQ(TruthOf("eventually(x_m > 2)", trace), Truth::kFalse);
  EXPECT_EQ(TruthOf("always[0,0.024](x_m < 3)", trace, planned_end_ns), Truth::kTrue);
  EXPECT_EQ(TruthOf("always[0,0.025](x_m < 3)", trace), Truth::kUnknown);
  EXPECT_EQ(TruthOf("always[0.03,0.04](x_m < 3)", trace), Truth::kUnknown);
  EXPECT_EQ(TruthOf("always(1 < 2)", trace, planned_end_ns), Truth::kTrue);
  EXPECT_EQ(TruthOf("(x_m < 1) until[0,1] (x_m > 5)", trace), Truth::kFalse);
  EXPECT_EQ(TruthOf("(x_m < 9) until[0,1] (x_m > 5)", trace), Truth::kUnknown);
  const Result open = Judge("always(x_m < 3)", trace, planned_end_ns);
  EXPECT_EQ(open.robustness, 1.0);  // of what was seen
  EXPECT_EQ(open.lower, -kInfinity);
  EXPECT_EQ(open.upper, 1.0);
  EXPECT_EQ(open.time_ns, 24 * kNsPerMs);
}

TEST(StlMonitor, TheLastRowTellsUpToTheFlightsEnd) {
  const Trace trace = MakeTrace({0, 1, 2});  // to 24 ms
  const auto truth = [&](const char* text) {
    return Evaluate(testing::ParseCriterion(text, kFaults), trace, Extent{30 * kNsPerMs, 30 * kNsPerMs})
        .truth;
  };
  EXPECT_EQ(truth("always(x_m < 3)"), Truth::kTrue);
  EXPECT_EQ(truth("always[0,0.03](x_m < 3)"), Truth::kTrue);
  EXPECT_EQ(truth("always[0.025,0.03](x_m > 1)"), Truth::kTrue);
  EXPECT_EQ(truth("always[0,0.031](x_m < 3)"), Truth::kUnknown);
}

TEST(StlMonitor, AnEmptyTraceDecidesOnlyWhatNeedsNoRow) {
  const Trace trace = MakeTrace({});
  EXPECT_EQ(TruthOf("always(x_m < 3)", trace), Truth::kUnknown);
  EXPECT_EQ(TruthOf("always(true)", trace), Truth::kTrue);
  EXPECT_EQ(Judge("always(x_m < 3)", trace).time_ns, std::nullopt);
}

TEST(StlMonitor, NanCountsAgainstTheFormulaWhereverItStands) {
  const Trace trace = MakeTrace({0, kNan, 0});
  for (const char* text :
       {"always(x_m <= 1)", "always(x_m > -1)", "always(not x_m > 1)", "always(not not x_m < 1)",
        "always(abs(x_m) <= 1)", "always(min(x_m, 0) <= 1)", "always(max(0, x_m) <= 1)",
        "always(x_m > 0 implies x_m > 1)", "not eventually(x_m > 1)", "always[0.012,0.012](x_m <= x_m)"}) {
    EXPECT_EQ(TruthOf(text, trace), Truth::kFalse) << text;
    EXPECT_EQ(Judge(text, trace).robustness, -kInfinity) << text;
    EXPECT_EQ(Judge(text, trace).time_ns, 12 * kNsPerMs) << text;
  }
  EXPECT_EQ(TruthOf("eventually(x_m >= 0)", trace), Truth::kTrue);
  EXPECT_EQ(Judge("always(x_m <= 1)", trace).evidence, "x_m = nan");
  EXPECT_EQ(TruthOf("x_m / x_m <= 1", trace), Truth::kFalse);  // 0 / 0
}

TEST(StlMonitor, TheFirstViolationIsTheTimeOfOne) {
  const Trace trace = MakeTrace({0, 2, 9, 2}, {0, 0, 0, 0.7});
  const Result broken = Judge("always(x_m <= 1 and abs(roll_rad) <= 0.6)", trace);
  EXPECT_EQ(broken.truth, Truth::kFalse);
  EXPECT_EQ(broken.robustness, -8.0);
  EXPECT_EQ(broken.time_ns, 12 * kNsPerMs);
  EXPECT_EQ(broken.evidence, "x_m = 2");
  const Result holds = Judge("always(x_m <= 10 and abs(roll_rad) <= 0.9)", trace);
  EXPECT_EQ(holds.time_ns, 36 * kNsPerMs);  // (0.9 - 0.7) / 0.5 is less than 10 - 9
  EXPECT_EQ(holds.evidence, "roll_rad = 0.7");
  EXPECT_EQ(Judge("eventually(x_m >= 2)", trace).time_ns, 12 * kNsPerMs);
  EXPECT_EQ(Judge("eventually(x_m >= 20)", trace).time_ns, 24 * kNsPerMs);
  EXPECT_EQ(Judge("always(x_m <= 1) and always(roll_rad < 0.6)", trace).time_ns, 12 * kNsPerMs);
  EXPECT_EQ(Judge("always(roll_rad < 0.6) and always(x_m <= 1)", trace).time_ns, 12 * kNsPerMs);
  EXPECT_EQ(Judge("always(x_m > 1 implies roll_rad > 0.1)", trace).evidence, "roll_rad = 0");
  EXPECT_EQ(Judge("(x_m < 3) until[0,0.036] (roll_rad > 0.6)", trace).time_ns, 24 * kNsPerMs);
  EXPECT_EQ(Judge("(x_m < 30) until[0,0.036] (roll_rad > 0.6)", trace).time_ns, 36 * kNsPerMs);
  EXPECT_EQ(Judge("x_m + roll_rad < x_m", trace).evidence, "x_m = 0, roll_rad = 0");
}

TEST(StlMonitor, FaultsAreTrueOrFalseAndWeighNothing) {
  Trace trace({"t_s", "x_m", "active_a"});
  for (int r = 0; r < 4; ++r) {
    const auto row = trace.AppendRow();
    row[0] = 0.012 * r;
    row[1] = r;
    row[2] = r == 2 ? 1.0 : 0.0;
  }
  EXPECT_EQ(Judge("always(fault_active(\"a\") implies x_m >= 0)", trace).robustness, 2.0);
  EXPECT_EQ(Judge("always(fault_active(\"a\") implies x_m >= 5)", trace).robustness, -3.0);
  EXPECT_EQ(Judge("eventually(fault_active(\"a\"))", trace).robustness, kInfinity);
  EXPECT_EQ(Judge("eventually(fault_active(\"a\"))", trace).time_ns, 24 * kNsPerMs);
  EXPECT_EQ(Judge("always(not fault_active(\"a\"))", trace).evidence, "fault_active(\"a\") is true");
  EXPECT_EQ(Judge("always(active_a <= 0)", trace).evidence, "active_a = 1");
}

TEST(StlMonitor, TheLastRowMayLieOffTheGrid) {
  Trace trace({"t_s", "x_m"});
  for (const double t_s : {0.0, 0.012, 0.02}) {
    const auto row = trace.AppendRow();
    row[0] = t_s;
    row[1] = t_s;
  }
  EXPECT_EQ(Judge("eventually[0.015,0.02](x_m >= 0)", trace).robustness, 0.02);
  EXPECT_EQ(TruthOf("always(x_m >= 0)", trace, 20 * kNsPerMs), Truth::kTrue);
}

TEST(StlMonitor, RefusesATraceThatItCannotRead) {
  Trace no_roll({"t_s", "x_m"});
  no_roll.AppendRow()[0] = 0.0;
  EXPECT_THROW(Judge("roll_rad <= 1", no_roll), std::invalid_argument);
  EXPECT_THROW(Judge("fault_active(\"a\")", no_roll), std::invalid_argument);
  no_roll.AppendRow()[0] = 0.0;
  EXPECT_THROW(Judge("x_m <= 1", no_roll), std::invalid_argument);  // time stands still
  Trace no_time({"x_m"});
  EXPECT_THROW(Judge("x_m <= 1", no_time), std::invalid_argument);
}

struct CountedMinimum {
  std::size_t* count;
  int operator()(int a, int b) const {
    ++*count;
    return std::min(a, b);
  }
};

TEST(SlidingFold, CostsThreeOperationsAValueAtMostWhateverTheWidth) {
  constexpr std::size_t kValues = 5001;
  std::vector<int> values(kValues);
  for (std::size_t i = 0; i < kValues; ++i) values[i] = static_cast<int>(i * 7919 % 1009);
  for (const std::size_t width : {1u, 2u, 64u, 1000u, 5001u}) {
    std::size_t count = 0;
    SlidingFold<int, CountedMinimum> fold(values, 1'000'000, CountedMinimum{&count});
    for (std::size_t i = 0; i < kValues; ++i) {
      const std::size_t last = std::min(kValues, i + width);
      const int lowest = fold.Over(i, last);
      const auto begin = values.begin() + static_cast<std::ptrdiff_t>(i);
      if (i % 97 == 0) {
        EXPECT_EQ(lowest, *std::min_element(begin, begin + static_cast<std::ptrdiff_t>(last - i)));
      }
    }
    EXPECT_LE(count, 3 * kValues) << width;
  }
}

TEST(SlidingFold, EmptyWindowsAreNeutralAndLeaveNothingBehind) {
  const std::vector<int> values = {5, 1, 4, 2, 3};
  std::size_t count = 0;
  SlidingFold<int, CountedMinimum> fold(values, 99, CountedMinimum{&count});
  EXPECT_EQ(fold.Over(0, 0), 99);
  EXPECT_EQ(fold.Over(0, 2), 1);
  EXPECT_EQ(fold.Over(2, 2), 99);
  EXPECT_EQ(fold.Over(2, 3), 4);
  EXPECT_EQ(fold.Over(4, 3), 99);
  EXPECT_EQ(fold.Over(4, 5), 3);
}

}  // namespace
}  // namespace tiltproof::harness::stl
