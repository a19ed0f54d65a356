#include "harness/report/difference.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tiltproof::harness {
namespace {

using ::testing::ElementsAre;

struct Judged {
  const char* name;
  Verdict verdict;
  std::optional<double> margin;
};

FlightResult Of(const std::string& name, Verdict verdict, const std::vector<Judged>& criteria) {
  FlightResult result;
  result.name = name;
  result.score.verdict = verdict;
  for (const auto& [criterion, its, margin] : criteria)
    result.score.criteria.push_back({.name = criterion,
                                     .verdict = its,
                                     .robustness = {},
                                     .time_s = {},
                                     .explanation = {},
                                     .margin = margin});
  return result;
}

FlightDifference Change(const FlightResult& before, const FlightResult& after, double tolerance = 0.01) {
  return CompareRuns({before}, {after}, tolerance).flights.front();
}

constexpr Verdict kPass = Verdict::kPass, kFail = Verdict::kFail;

TEST(Regression, OfAVerdictIsWorseInTheOrderOfPrecedence) {
  const Verdict order[] = {Verdict::kPass, Verdict::kInconclusive, Verdict::kFail, Verdict::kError};
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) {
      const FlightDifference change = Change(Of("x", order[i], {}), Of("x", order[j], {}));
      EXPECT_EQ(change.worse(), j > i) << i << " " << j;
      EXPECT_EQ(change.better(), j < i) << i << " " << j;
    }
  }
}

TEST(Regression, OfAMarginIsOneBeyondTheTolerance) {
  const auto with = [](double margin) { return Of("x", kPass, {{"near", kPass, margin}}); };
  EXPECT_FALSE(Change(with(0.5), with(0.5), 0.0).worse());
  EXPECT_TRUE(Change(with(0.5), with(0.4999999), 0.0).worse());
  EXPECT_FALSE(Change(with(0.5), with(0.4901)).worse());
  EXPECT_TRUE(Change(with(0.5), with(0.4899)).worse());
  EXPECT_TRUE(Change(with(0.5), with(0.52)).better());
  EXPECT_FALSE(Change(with(0.5), with(0.505)).better());
}

// The least margin of the flight does not fall here, nor does its verdict.
TEST(Regression, IsSeenInEachCriterion) {
  const FlightResult before =
      Of("x", kFail, {{"near", kFail, -1.0}, {"calm", kPass, 0.9}, {"fine", kPass, {}}});
  EXPECT_TRUE(
      Change(before, Of("x", kFail, {{"near", kFail, -1.0}, {"calm", kPass, 0.1}, {"fine", kPass, {}}}))
          .worse());
  EXPECT_TRUE(
      Change(before, Of("x", kFail, {{"near", kFail, -1.0}, {"calm", kPass, 0.9}, {"fine", kFail, {}}}))
          .worse());
  EXPECT_TRUE(Change(before, Of("x", kFail, {{"near", kFail, -1.0}, {"calm", kPass, 0.9}})).worse())
      << "not judged";
  // One more is judged: nothing to compare it with.
  EXPECT_FALSE(
      Change(before,
             Of("x", kFail,
                {{"near", kFail, -1.0}, {"calm", kPass, 0.9}, {"fine", kPass, {}}, {"new", kFail, -3}}))
          .worse());
  // Some better, one worse: worse.
  const FlightDifference mixed =
      Change(before, Of("x", kPass, {{"near", kPass, 0.4}, {"calm", kPass, 0.1}, {"fine", kPass, {}}}));
  EXPECT_TRUE(mixed.worse());
  EXPECT_FALSE(mixed.better());
}

TEST(Regression, NamesFlightsOfOneRunOnly) {
  const RunDifference regression =
      CompareRuns({Of("a", kPass, {}), Of("b", kPass, {})}, {Of("c", kFail, {}), Of("a", kPass, {})}, 0.0);
  EXPECT_THAT(regression.only_a, ElementsAre("b"));
  EXPECT_THAT(regression.only_b, ElementsAre("c"));
  EXPECT_EQ(regression.worse_count(), 0U);
  EXPECT_TRUE(regression.worse()) << "a gate is not passed by flying less";
  EXPECT_FALSE(CompareRuns({Of("a", kPass, {})}, {Of("c", kFail, {}), Of("a", kPass, {})}, 0.0).worse());
}

using Pairs = std::vector<std::pair<std::size_t, std::size_t>>;
using Places = std::vector<std::size_t>;

TEST(PairFlights, ByNameInTheOrderOfA) {
  const FlightPairs pairing = PairFlights({{"c", "a", "b"}}, {{"b", "x", "c"}});
  EXPECT_EQ(pairing.pairs, (Pairs{{0, 2}, {2, 0}}));
  EXPECT_EQ(pairing.only_a, (Places{1}));
  EXPECT_EQ(pairing.only_b, (Places{1}));
}

TEST(PairFlights, OneThatWasAskedForLeavesNoneMissing) {
  const FlightPairs pairing = PairFlights({{"a", "b", "c"}}, {{"b"}, false});
  EXPECT_EQ(pairing.pairs, (Pairs{{1, 0}}));
  EXPECT_THAT(pairing.only_a, ElementsAre());
  const FlightPairs other = PairFlights({{"b"}, false}, {{"a", "b"}});
  EXPECT_EQ(other.pairs, (Pairs{{0, 1}}));
  EXPECT_THAT(other.only_b, ElementsAre());
  // It is missing itself.
  EXPECT_EQ(PairFlights({{"z"}, false}, {{"a", "b"}}).only_a, (Places{0}));
}

TEST(PairFlights, TwoThatWereAskedForAreAPairWhateverTheirNames) {
  EXPECT_EQ(PairFlights({{"a"}, false}, {{"b"}, false}).pairs, (Pairs{{0, 0}}));
  EXPECT_EQ(PairFlights({{}, false}, {{"b"}, false}).pairs, Pairs{});
}

TEST(Regression, TwoFlightsThatWereAskedForHaveTheNameOfTheFirst) {
  const RunDifference runs = CompareRuns({Of("a", kPass, {})}, {Of("b", kFail, {})}, 0.0, false, false);
  ASSERT_EQ(runs.flights.size(), 1U);
  EXPECT_EQ(runs.flights.front().name, "a");
  EXPECT_TRUE(runs.worse());
}

}  // namespace
}  // namespace tiltproof::harness
