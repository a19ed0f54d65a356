// The search for the moment of no return over planted chances, and causes against all subsets tried one by one.
#include "harness/campaign/no_return.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <random>
#include <set>
#include <vector>

#include "harness/campaign/causes.h"

namespace tiltproof::harness {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr TimeNs kStep = 12 * kNsPerMs;

// Moments that were asked for, and the answers of a function of time: 0 or 1.
NoReturn FindIn(double begin_s, double end_s, const std::function<bool(double)>& fails,
                std::vector<double>* asked = nullptr, std::size_t moments_max = 40) {
  return FindNoReturn({FromSeconds(begin_s), FromSeconds(end_s), kStep, moments_max},
                      [&](const std::vector<TimeNs>& moments) {
                        std::vector<FutureCount> counts;
                        for (const TimeNs t : moments) {
                          if (asked != nullptr) asked->push_back(ToSeconds(t));
                          counts.push_back({1, fails(ToSeconds(t)) ? std::size_t{1} : std::size_t{0}, false});
                        }
                        return counts;
                      });
}

TEST(NoReturn, AThresholdIsFoundToOneStep) {
  std::mt19937 random(1);
  for (int i = 0; i < 100; ++i) {
    const double begin_s = static_cast<double>(random() % 5000) / 1000;
    const double length_s = 1 + static_cast<double>(random() % 60000) / 1000;
    const double threshold_s = begin_s + length_s * static_cast<double>(random() % 1000 + 1) / 1001;
    std::vector<double> asked;
    const NoReturn found = FindIn(
        begin_s, begin_s + length_s, [&](double t) { return t >= threshold_s; }, &asked);
    ASSERT_TRUE(found.last_chance_s && found.point_of_no_return_s);
    EXPECT_LT(*found.last_chance_s, threshold_s);
    EXPECT_GE(*found.point_of_no_return_s, threshold_s);
    EXPECT_LE(*found.point_of_no_return_s - *found.last_chance_s, ToSeconds(kStep) + 1e-9);
    EXPECT_LE(asked.size(), 24u);
    EXPECT_EQ(std::set<double>(asked.begin(), asked.end()).size(), asked.size())
        << "a moment was asked for twice";
    EXPECT_EQ(found.curve.size(), asked.size());
    for (const WhyPoint& point : found.curve) EXPECT_EQ(point.low, point.high);
  }
}

// Lost in [3, 4) s, then saved again by what the flight does, and lost for good from 7 s on.
TEST(NoReturn, TheLastLossCounts) {
  const NoReturn found = FindIn(1, 9, [](double t) { return (t >= 3 && t < 4) || t >= 7; });
  EXPECT_NEAR(found.point_of_no_return_s.value(), 7, 0.0121);
  EXPECT_NEAR(found.last_chance_s.value(), 7, 0.0121);
  const auto lost_at_first = std::find_if(found.curve.begin(), found.curve.end(),
                                          [](const WhyPoint& p) { return p.probability > 0; });
  EXPECT_NEAR(lost_at_first->time_s, 3, 0.0121);
}

TEST(NoReturn, LostFromTheFirstMomentOrNever) {
  const NoReturn at_once = FindIn(2, 5, [](double) { return true; });
  EXPECT_EQ(at_once.last_chance_s, std::nullopt);
  EXPECT_EQ(at_once.point_of_no_return_s, 2);
  const NoReturn never = FindIn(2, 5, [](double) { return false; });
  EXPECT_EQ(never.last_chance_s, 5);
  EXPECT_EQ(never.point_of_no_return_s, std::nullopt);
}

TEST(NoReturn, ARangeOfNoLengthHasOneMoment) {
  const NoReturn found = FindIn(2, 2, [](double) { return true; });
  ASSERT_EQ(found.curve.size(), 1u);
  EXPECT_EQ(found.point_of_no_return_s, 2);
}

TEST(NoReturn, AsksForNoMoreMomentsThanAllowed) {
  for (const std::size_t most : {2u, 3u, 7u, 12u}) {
    std::vector<double> asked;
    FindIn(
        0, 60, [](double t) { return t >= 31.7; }, &asked, most);
    EXPECT_LE(asked.size(), most);
  }
}

TEST(NoReturn, AnInterruptKeepsWhatIsKnown) {
  const NoReturn found = FindNoReturn({0, kNsPerS, kStep}, [](const std::vector<TimeNs>&) {
    return std::vector<FutureCount>{{1, 0, false}, {1, 0, false}};
  });
  EXPECT_EQ(found.curve.size(), 2u);
}

// Chances that rise as a logistic curve, in 100 futures each: found to 0.5 s in 19 of 20.
TEST(NoReturn, RandomFuturesShowTheHalf) {
  int found_count = 0;
  for (std::uint32_t seed = 0; seed < 20; ++seed) {
    std::mt19937 random(seed);
    const double half_s = 5 + static_cast<double>(random() % 5000) / 100, width_s = 0.2 + 0.05 * (seed % 5);
    const NoReturn found =
        FindNoReturn({FromSeconds(2), FromSeconds(60), kStep}, [&](const std::vector<TimeNs>& moments) {
          std::vector<FutureCount> counts;
          for (const TimeNs t : moments) {
            FutureCount& count = counts.emplace_back(FutureCount{100, 0, true});
            const double chance = 1 / (1 + std::exp((half_s - ToSeconds(t)) / width_s));
            for (int i = 0; i < 100; ++i)
              count.fails += static_cast<double>(random()) < chance * 4294967296.0 ? 1 : 0;
          }
          return counts;
        });
    found_count += std::abs(found.point_of_no_return_s.value_or(-1) - half_s) <= 0.5 ? 1 : 0;
    EXPECT_LE(found.curve.size(), 40u);
    for (const WhyPoint& point : found.curve) {
      EXPECT_LE(point.low, point.probability);
      EXPECT_GE(point.high, point.probability);
      EXPECT_LT(point.low, point.high);
    }
  }
  EXPECT_GE(found_count, 19);
}

Causes CausesOf(const FaultSet& all, const std::function<bool(const FaultSet&)>& fails,
                std::size_t most = 1000) {
  return FindCauses(
      all,
      [&](const std::vector<FaultSet>& sets) {
        std::vector<bool> answers;
        for (const FaultSet& kept : sets) answers.push_back(fails(kept));
        return answers;
      },
      most);
}

// Random flights of six faults that fail when all faults of one of some sets act.
TEST(Causes, AreThoseOfAllSubsets) {
  std::mt19937 random(3);
  int with_needed = 0, with_sets = 0;
  for (int trial = 0; trial < 300; ++trial) {
    std::vector<std::uint32_t> planted;
    for (std::uint32_t i = 0; i < 1 + random() % 3; ++i)
      planted.push_back(static_cast<std::uint32_t>(random() % 63 + 1));
    const auto fails_mask = [&](std::uint32_t kept) {
      return std::any_of(planted.begin(), planted.end(),
                         [&](std::uint32_t set) { return (kept & set) == set; });
    };
    std::vector<std::size_t> needed;
    for (std::size_t fault = 0; fault < 6; ++fault)
      if (!fails_mask(63 & ~(1u << fault))) needed.push_back(fault);
    std::set<FaultSet> smallest;
    for (std::uint32_t kept = 0; kept < 64 && needed.empty(); ++kept) {
      bool is_smallest = fails_mask(kept);
      FaultSet set;
      for (std::size_t fault = 0; fault < 6; ++fault)
        if ((kept >> fault & 1u) != 0) {
          set.insert(fault);
          is_smallest &= !fails_mask(kept & ~(1u << fault));
        }
      if (is_smallest) smallest.insert(set);
    }
    const Causes causes = CausesOf({0, 1, 2, 3, 4, 5}, [&](const FaultSet& kept) {
      std::uint32_t mask = 0;
      for (const std::size_t fault : kept) mask |= 1u << fault;
      return fails_mask(mask);
    });
    EXPECT_TRUE(causes.complete);
    EXPECT_EQ(causes.needed, needed);
    EXPECT_EQ(std::set<FaultSet>(causes.sets.begin(), causes.sets.end()), smallest);
    with_needed += needed.empty() ? 0 : 1;
    with_sets += smallest.size() > 1 ? 1 : 0;
  }
  EXPECT_GT(with_needed, 50);
  EXPECT_GT(with_sets, 50);
}

TEST(Causes, OfAFlightThatFailsByItselfAreNone) {
  const Causes causes = CausesOf({0, 1}, [](const FaultSet&) { return true; });
  EXPECT_THAT(causes.needed, IsEmpty());
  EXPECT_THAT(causes.sets, ElementsAre(FaultSet{}));
}

TEST(Causes, ReportThatTheTestsRanOut) {
  FaultSet all;
  for (std::size_t fault = 0; fault < 40; ++fault) all.insert(fault);
  const auto fails = [](const FaultSet& kept) {
    return (kept.contains(3) && kept.contains(17)) || (kept.contains(20) && kept.contains(39));
  };
  const Causes few = CausesOf(all, fails, 60);
  EXPECT_FALSE(few.complete);
  EXPECT_LE(few.tests_count, 60u);
  const Causes enough = CausesOf(all, fails, 200);
  EXPECT_TRUE(enough.complete);
  EXPECT_THAT(enough.sets, ElementsAre(FaultSet{3, 17}, FaultSet{20, 39}));
}

}  // namespace
}  // namespace tiltproof::harness
