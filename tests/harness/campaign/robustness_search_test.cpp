// The search for the least robust flight, without flying: planted triggers, and what must hold for any function.
#include "harness/campaign/robustness_search.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <set>

#include "tests/harness/campaign/planted_triggers.h"

namespace tiltproof::harness {
namespace {

using faults::KeyOf;
using faults::Random;
using faults::StreamKey;

constexpr std::size_t kSeeds = 20, kFlights = 200;

std::size_t MedianFirstFailure(const testing::PlantedTrigger& trigger) {
  std::vector<std::size_t> counts;
  for (std::size_t seed = 0; seed < kSeeds; ++seed) {
    Random random(KeyOf(StreamKey(1, {"planted", trigger.name}), seed));
    counts.push_back(testing::FirstFailure(trigger, trigger.plant(random), seed, kFlights));
  }
  std::sort(counts.begin(), counts.end());
  return counts[kSeeds / 2];  // the upper of the two in the middle
}

TEST(PlantedTriggers, AreNarrow) {
  for (const testing::PlantedTrigger& trigger : testing::PlantedTriggers()) {
    std::size_t hits = 0;
    constexpr std::size_t kPlantings = 20, kDraws = 20'000;
    for (std::size_t seed = 0; seed < kPlantings; ++seed) {
      Random random(KeyOf(StreamKey(1, {"planted", trigger.name}), seed));
      const testing::Robustness robustness = trigger.plant(random);
      for (std::size_t drawn = 0; drawn < kDraws;) {
        const std::size_t first = testing::FirstRandomFailure(trigger, robustness, random, kDraws - drawn);
        if (first > kDraws - drawn) break;
        drawn += first;
        ++hits;
      }
    }
    // 40 are expected of a chance of 1e-4; three standard deviations more would be 59.
    EXPECT_LT(hits, 59) << trigger.name;
    EXPECT_GT(hits, 0) << trigger.name;
  }
}

TEST(RobustnessSearch, FindsPlantedTriggers) {
  for (const testing::PlantedTrigger& trigger : testing::PlantedTriggers()) {
    if (trigger.name == "beside a decoy") continue;  // most seeds miss it: docs/search.md says so
    const std::size_t median = MedianFirstFailure(trigger);
    RecordProperty(trigger.name, static_cast<int>(median));
    EXPECT_LE(median, kFlights) << trigger.name;
  }
}

TEST(RobustnessSearch, AsksTheSameWithTheSameStreamAndAnswers) {
  const auto asked = [](std::uint64_t stream) {
    RobustnessSearch search({{}, {.values_count = 3, .ordered = false}}, stream);
    std::vector<SearchPoint> all;
    while (search.told_count() < 60) {
      const std::vector<SearchPoint> points = search.Ask();
      std::vector<double> robustness;
      for (const SearchPoint& point : points) robustness.push_back(std::abs(point[0] - 0.3) + point[1]);
      search.Tell(robustness);
      all.insert(all.end(), points.begin(), points.end());
    }
    return all;
  };
  EXPECT_EQ(asked(5), asked(5));
  EXPECT_NE(asked(5), asked(6));
}

TEST(RobustnessSearch, AsksOnlyPointsOfItsAxes) {
  RobustnessSearch search({{}, {.values_count = 7}, {.values_count = 3, .ordered = false}}, 9);
  std::set<double> names;
  while (search.told_count() < 400) {
    std::vector<double> robustness;
    for (const SearchPoint& point : search.Ask()) {
      ASSERT_EQ(point.size(), 3U);
      ASSERT_TRUE(point[0] >= 0 && point[0] <= 1) << point[0];
      ASSERT_TRUE(point[1] >= 0 && point[1] <= 6 && std::floor(point[1]) == point[1]) << point[1];
      ASSERT_TRUE(point[2] >= 0 && point[2] <= 2 && std::floor(point[2]) == point[2]) << point[2];
      names.insert(point[2]);
      robustness.push_back(point[0] + point[1]);
    }
    search.Tell(robustness);
  }
  EXPECT_THAT(names, ::testing::ElementsAre(0, 1, 2));
  ASSERT_NE(search.best(), nullptr);
  EXPECT_EQ((*search.best())[0], 0) << "the end itself of the range is tried";
  EXPECT_EQ((*search.best())[1], 0);
}

TEST(RobustnessSearch, BeginsWithTheGivenPoint) {
  const SearchPoint own = {0.125, 2};
  RobustnessSearch search({{}, {.values_count = 4}}, 3, own);
  EXPECT_EQ(search.Ask().front(), own);
}

TEST(RobustnessSearch, GoesOnWhereNothingIsKnown) {
  // Flat, unknown, and all points of whole numbers flown.
  for (const double value :
       {1.0, std::numeric_limits<double>::infinity(), std::numeric_limits<double>::quiet_NaN(), -1e300}) {
    RobustnessSearch search({{.values_count = 2}, {.values_count = 2, .ordered = false}}, 1);
    while (search.told_count() < 100) search.Tell(std::vector<double>(search.Ask().size(), value));
  }
  // With a pass or a fail alone it spreads its points: as many parts of the range are visited as by chance.
  RobustnessSearch search({{}, {}}, 4);
  std::set<std::pair<int, int>> parts;
  while (search.told_count() < 200) {
    const auto points = search.Ask();
    for (const SearchPoint& point : points)
      parts.emplace(static_cast<int>(point[0] * 10), static_cast<int>(point[1] * 10));
    search.Tell(std::vector<double>(points.size(), 1.0));
  }
  EXPECT_GT(parts.size(), 80U);
}

}  // namespace
}  // namespace tiltproof::harness
