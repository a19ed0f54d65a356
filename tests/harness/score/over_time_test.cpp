// The robustness of a criterion over time, by hand; stl_property_test.cpp holds it against the definitions.
#include <gtest/gtest.h>

#include "harness/score/score.h"
#include "tests/harness/score/still_flight.h"
#include "tests/support/control_period.h"

namespace tiltproof::harness {
namespace {

stl::OverTime OverTimeOf(const std::string& formula, const std::vector<double>& x_m) {
  RunLog log = StillFlight(x_m.size());
  for (std::size_t r = 0; r < x_m.size(); ++r)
    log.trace.mutable_row(r)[log.trace.Find("x_m").value()] = x_m[r];
  Scenario scenario = ScenarioOf(log);
  scenario.criteria = {{.name = "c", .stl = formula, .metric = "", .min = {}, .max = {}}};
  EXPECT_FALSE(ScoreRun(scenario, log).criteria.back().over_time.has_value());
  return ScoreRun(scenario, log, {.over_time = true}).criteria.back().over_time.value();
}
std::vector<double> ValuesOf(const stl::OverTime& over_time) {
  std::vector<double> values;
  for (const stl::RowRobustness& row : over_time.rows) {
    EXPECT_EQ(row.lower, row.upper);
    values.push_back(row.lower);
  }
  return values;
}

// 1 m before its window and after it, at most 0.375 m within: the criterion holds, and no part of its curve is below 0.
TEST(OverTime, AWindowedCriterionHasValuesInItsWindowAlone) {
  const std::vector<double> x_m = {1, 0.25, 0.375, 0.125, 1, 1};
  const stl::OverTime inside = OverTimeOf("always[0.012,0.036](x_m <= 0.5)", x_m);
  EXPECT_EQ(inside.reading, stl::OverTimeReading::kLowest);
  EXPECT_FALSE(inside.looks_ahead);
  EXPECT_EQ(inside.rows.front().time_ns, kControlPeriodNs);
  EXPECT_EQ(ValuesOf(inside), (std::vector<double>{0.25, 0.125, 0.375}));
  const stl::OverTime once = OverTimeOf("eventually[0.024,1](x_m <= 0.25)", x_m);
  EXPECT_EQ(once.reading, stl::OverTimeReading::kHighest);
  EXPECT_EQ(ValuesOf(once), (std::vector<double>{-0.125, 0.125, -0.75, -0.75}));
}

TEST(OverTime, TheCurveCrossesZeroAtTheFirstViolation) {
  const stl::OverTime over_time = OverTimeOf("not eventually[0,0.036](not (x_m <= 0.5))", {0, 0, 1, 1, 1});
  EXPECT_EQ(ValuesOf(over_time), (std::vector<double>{0.5, 0.5, -0.5, -0.5}));
}

TEST(OverTime, NestedWindowsAreOneAndOthersAreReadAsTheyStand) {
  const std::vector<double> x_m = {0, 0.125, 0.25, 0.375, 0.5};
  const stl::OverTime one = OverTimeOf("always[0,0.012](always[0.012,0.024](x_m <= 1))", x_m);
  EXPECT_EQ(one.rows.front().time_ns, kControlPeriodNs);
  EXPECT_EQ(ValuesOf(one), (std::vector<double>{0.875, 0.75, 0.625}));
  // Each row waits for what follows.
  const stl::OverTime ahead = OverTimeOf("always[0,0.024](eventually[0,0.012](x_m >= 0.125))", x_m);
  EXPECT_EQ(ahead.reading, stl::OverTimeReading::kLowest);
  EXPECT_TRUE(ahead.looks_ahead);
  EXPECT_EQ(ValuesOf(ahead), (std::vector<double>{0, 0.125, 0.25}));
  // No value of a single row decides: as if the flight began in it.
  const stl::OverTime from_here = OverTimeOf("(x_m <= 0.25) until[0,0.012] (x_m >= 0.125)", x_m);
  EXPECT_EQ(from_here.reading, stl::OverTimeReading::kFromHere);
  ASSERT_EQ(from_here.rows.size(), 5u);
  EXPECT_EQ(from_here.rows[0].lower, 0);
  EXPECT_EQ(from_here.rows[3].lower, 0.25);
}

}  // namespace
}  // namespace tiltproof::harness
