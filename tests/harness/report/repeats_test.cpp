#include "harness/report/repeats.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tiltproof::harness {
namespace {

constexpr double kZ = 1.959963984540054;

// Its ends are the shares from which what was seen is just z standard deviations away: the definition, not the formula.
TEST(WilsonInterval, EndsWhereTheObservationIsJustUnlikely) {
  for (const std::size_t n : {1, 2, 5, 10, 37, 1000}) {
    for (std::size_t k = 0; k <= n; ++k) {
      const auto [low, high] = WilsonInterval(k, n);
      const double seen = static_cast<double>(k) / static_cast<double>(n);
      EXPECT_LE(0.0, low);
      EXPECT_LE(low, seen);
      EXPECT_LE(seen, high);
      EXPECT_LE(high, 1.0);
      for (const double end : {low, high}) {
        if ((k == 0 && end == low) || (k == n && end == high)) continue;
        const double away = std::abs(seen - end);
        EXPECT_NEAR(away, kZ * std::sqrt(end * (1 - end) / static_cast<double>(n)), 1e-12)
            << k << " of " << n;
      }
    }
  }
}

TEST(WilsonInterval, IsThatOfPublishedTables) {
  // R 4: prop.test(x, n, correct = FALSE)$conf.int
  const auto [low, high] = WilsonInterval(8, 10);
  EXPECT_NEAR(low, 0.4901625, 1e-7);
  EXPECT_NEAR(high, 0.9433178, 1e-7);
  EXPECT_NEAR(WilsonInterval(0, 10).second, 0.2775328, 1e-7);
}

FlightResult Flown(const std::string& name, Verdict verdict, std::optional<double> margin) {
  FlightResult result;
  result.name = name;
  result.score.verdict = verdict;
  result.score.criteria = {
      {.name = "wide", .verdict = verdict, .robustness = {}, .time_s = {}, .explanation = {}, .margin = 5.0},
      {.name = "near",
       .verdict = verdict,
       .robustness = {},
       .time_s = {},
       .explanation = {},
       .margin = margin}};
  return result;
}

TEST(RepeatsOf, FindsTheWorstOfEachScenario) {
  const std::vector<FlightResult> results = {
      Flown("a1", Verdict::kPass, 0.2),  Flown("b1", Verdict::kPass, 0.2),
      Flown("a2", Verdict::kPass, 0.01), Flown("b2", Verdict::kFail, -0.1),
      Flown("a3", Verdict::kPass, 0.5),  Flown("b3", Verdict::kFail, -0.7),
      Flown("a4", Verdict::kError, {}),  Flown("b4", Verdict::kInconclusive, -2.0)};
  const auto all = RepeatsOf(results, {"a", "b", "a", "b", "a", "b", "a", "b"});
  ASSERT_EQ(all.size(), 2U);
  EXPECT_EQ(all[0].scenario, "a");
  EXPECT_EQ(all[0].flown, 4U);
  EXPECT_EQ(all[0].passed, 3U);
  EXPECT_EQ(all[0].errors, 1U);
  EXPECT_EQ(all[0].worst->name, "a2") << "an error says nothing of the firmware";
  EXPECT_EQ(all[0].margin, 0.01);
  EXPECT_EQ(all[0].criterion, "near");
  EXPECT_EQ(all[1].worst->name, "b3") << "a flight that fails is worse than one that is undecided";
  EXPECT_EQ(all[1].passed, 1U);
  EXPECT_FALSE(all[1].all_the_same);
}

FlightResult WithoutMargin(const std::string& name, Verdict verdict, double survived_s) {
  FlightResult result = Flown(name, verdict, {});
  result.score.criteria.clear();
  result.score.metrics["survival.time_s"] = survived_s;
  return result;
}

// A restart fails `survival` and no other criterion.
TEST(RepeatsOf, FailuresWithAMarginComeBeforeThoseThatHaveNone) {
  const std::vector<FlightResult> results = {WithoutMargin("a1", Verdict::kFail, 9),
                                             Flown("a2", Verdict::kFail, -0.1),
                                             Flown("a3", Verdict::kFail, -0.2)};
  const auto all = RepeatsOf(results, {"a", "a", "a"});
  EXPECT_EQ(all[0].worst->name, "a3");
  EXPECT_EQ(all[0].margin, -0.2);
  EXPECT_FALSE(all[0].survived_s);
}

TEST(RepeatsOf, OfFailuresWithoutAMarginTheShortestIsTheWorst) {
  const std::vector<FlightResult> results = {
      Flown("a1", Verdict::kPass, 0.1), WithoutMargin("a2", Verdict::kFail, 9),
      WithoutMargin("a3", Verdict::kFail, 2.5), WithoutMargin("a4", Verdict::kFail, 4)};
  const auto all = RepeatsOf(results, {"a", "a", "a", "a"});
  EXPECT_EQ(all[0].worst->name, "a3");
  EXPECT_FALSE(all[0].margin);
  EXPECT_EQ(all[0].survived_s, 2.5);
}

}  // namespace
}  // namespace tiltproof::harness
