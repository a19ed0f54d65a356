// The search against responses that are known: monotonic and not, in both directions, on both scales.
#include "harness/campaign/margin_search.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <optional>
#include <set>
#include <utility>
#include <vector>

namespace tiltproof::harness {
namespace {

using faults::Scale;
using ::testing::DoubleNear;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::Ge;
using ::testing::Le;

struct Found {
  std::optional<double> survives, fails;
  std::vector<double> levels;  // that were tried
  std::vector<Pocket> pockets;
  std::optional<double> share;
};

Found Search(const LevelRange& range, const std::function<bool(double)>& survives, double tolerance = 0.01) {
  MarginSearch search(range, tolerance);
  Found found;
  while (const std::optional<double> level = search.next()) {
    found.levels.push_back(*level);
    search.Take(survives(*level));
    EXPECT_LT(found.levels.size(), 400u) << "no end";
    if (found.levels.size() > 400) break;
  }
  found.survives = search.survives();
  found.fails = search.fails();
  found.pockets = search.pockets();
  found.share = search.survived_share();
  EXPECT_EQ(std::set<double>(found.levels.begin(), found.levels.end()).size(), found.levels.size())
      << "no level is tried twice";
  EXPECT_TRUE(!found.survives || survives(*found.survives));
  EXPECT_TRUE(!found.fails || !survives(*found.fails));
  return found;
}

TEST(MarginSearch, FindsALimitOnALinearScale) {
  for (const double limit : {0.001, 0.5, 3.3, 9.99}) {
    const Found found = Search({.start = 0, .end = 10, .harmless = 0.0}, [&](double x) { return x < limit; });
    EXPECT_LT(*found.survives, limit);
    EXPECT_GE(*found.fails, limit);
    EXPECT_LE(*found.fails - *found.survives, 0.01 * *found.fails) << limit;
  }
}

TEST(MarginSearch, FindsALimitBelowTheHarmlessValue) {
  // A rotor is lost from 1 to 0; the tolerance is a share of what is lost.
  const Found found = Search({.start = 1, .end = 0, .harmless = 1.0}, [](double x) { return x > 0.85; });
  EXPECT_GT(*found.survives, 0.85);
  EXPECT_LE(*found.fails, 0.85);
  EXPECT_LE(*found.survives - *found.fails, 0.01 * (1 - *found.fails));
}

TEST(MarginSearch, FindsALimitOnALogarithmicScale) {
  for (const double limit : {2e-9, 3e-5, 0.16, 0.999}) {
    const Found found = Search({.start = 0, .end = 1, .scale = Scale::kLogarithmic, .harmless = 0.0},
                               [&](double x) { return x < limit; });
    EXPECT_LT(*found.survives, limit);
    EXPECT_GE(*found.fails, limit);
    EXPECT_LE(*found.fails - *found.survives, 0.01 * *found.fails) << limit;
  }
}

TEST(MarginSearch, FindsALimitTowardsZeroOnALogarithmicScale) {
  // A rate limit is harmless at infinity: at 1e6.
  for (const double limit : {500.0, 1.7, 2e-4}) {
    const Found found = Search({.start = 1e6, .end = 0, .scale = Scale::kLogarithmic, .harmless = 1e6},
                               [&](double x) { return x > limit; });
    EXPECT_GT(*found.survives, limit);
    EXPECT_LE(*found.fails, limit);
    EXPECT_LE(*found.survives - *found.fails, 0.01 * *found.survives) << limit;
  }
}

TEST(MarginSearch, FindsALimitOnBothSidesOfAFactor) {
  const Found above = Search({.start = 1, .end = 1000, .scale = Scale::kLogarithmic, .harmless = 1.0},
                             [](double x) { return x < 1.124; });
  EXPECT_LT(*above.survives, 1.124);
  EXPECT_GE(*above.fails, 1.124);
  EXPECT_LE(*above.fails - *above.survives, 0.01 * 0.126) << "a share of the distance from 1";
  const Found below = Search({.start = 1, .end = 0.001, .scale = Scale::kLogarithmic, .harmless = 1.0},
                             [](double x) { return x > 0.9; });
  EXPECT_GT(*below.survives, 0.9);
  EXPECT_LE(*below.fails, 0.9);
  EXPECT_LE(*below.survives - *below.fails, 0.01 * 0.102);
}

TEST(MarginSearch, AnythingIsSurvived) {
  const auto all = [](double) { return true; };
  for (const LevelRange& range : {LevelRange{.start = 0, .end = 10}, LevelRange{.start = 1, .end = 0},
                                  LevelRange{.start = 0, .end = 1, .scale = Scale::kLogarithmic},
                                  LevelRange{.start = 1e6, .end = 0, .scale = Scale::kLogarithmic},
                                  LevelRange{.start = 0, .end = -1e6, .harmless = 0.0, .typical = 0.5}}) {
    const Found found = Search(range, all);
    EXPECT_EQ(found.survives, range.end);
    EXPECT_EQ(found.fails, std::nullopt);
    EXPECT_LE(found.levels.size(), 130u);
    EXPECT_THAT(*found.share, DoubleNear(1.0, 1e-9));
  }
}

TEST(MarginSearch, NothingIsSurvived) {
  const auto none = [](double) { return false; };
  const Found linear = Search({.start = 0, .end = 10}, none);
  EXPECT_EQ(linear.survives, std::nullopt);
  EXPECT_EQ(linear.fails, 0.0);
  EXPECT_THAT(linear.levels, ElementsAre(0.0));
  const Found open = Search({.start = 0, .end = 1, .scale = Scale::kLogarithmic}, none);
  EXPECT_EQ(open.survives, std::nullopt);
  EXPECT_THAT(*open.fails, DoubleNear(1e-12, 1e-16)) << "the mildest level that was tried";
  const Found part = Search({.start = 0.1, .end = 1, .scale = Scale::kLogarithmic, .harmless = 0.0}, none);
  EXPECT_EQ(part.survives, std::nullopt);
  EXPECT_EQ(part.fails, 0.1);
}

TEST(MarginSearch, ReportsWhereAHigherLevelIsSurvivedAgain) {
  // Survived up to 3, from 5 to 6 and beyond 8.
  const auto pockets = [](double x) { return x < 3 || (x > 5 && x < 6) || x > 8; };
  const Found found = Search({.start = 0, .end = 10}, pockets);
  EXPECT_THAT(*found.fails, DoubleNear(3, 0.03));
  ASSERT_EQ(found.pockets.size(), 2u);
  EXPECT_EQ(found.pockets[0].from, *found.fails);
  EXPECT_THAT(found.pockets[0].to, DoubleNear(5, 0.5));
  EXPECT_THAT(found.pockets[1].from, DoubleNear(6, 0.5));
  EXPECT_THAT(found.pockets[1].to, DoubleNear(8, 0.5));
  EXPECT_THAT(*found.share, DoubleNear(0.6, 0.1)) << "of the range";
  EXPECT_EQ(Search({.start = 0, .end = 10}, [](double x) { return x < 3; }).pockets, std::vector<Pocket>());
}

// Pockets that a search by steps of a twelfth and bisection went past: the limit is before them.
TEST(MarginSearch, NoPocketBelowTheLimitIsWiderThanItsSteps) {
  for (double width : {0.034, 0.05, 0.2}) {
    for (double at = 0.05; at < 0.93; at += 0.0171) {
      for (const double limit : {0.0007, 0.31, 1.0}) {
        const auto fails_in = [&](double x) { return x > at * limit && x < (at + width) * limit; };
        const Found found = Search({.start = 0, .end = 1, .harmless = 0.0},
                                   [&](double x) { return x <= limit && !fails_in(x); });
        EXPECT_THAT(*found.fails, DoubleNear(at * limit, 0.012 * at * limit)) << at << " of " << limit;
      }
    }
  }
}

TEST(MarginSearch, NoPocketOnALogarithmicScaleIsWiderThanItsSteps) {
  for (double at = 1e-5; at < 0.1; at *= 1.31) {
    const auto survives = [&](double x) { return x < 0.2 && (x < at || x > at * 1.35); };
    const Found found =
        Search({.start = 0, .end = 1, .scale = Scale::kLogarithmic, .harmless = 0.0}, survives);
    EXPECT_THAT(*found.fails, DoubleNear(at, 0.012 * at));
    const Found down = Search({.start = 1e6, .end = 0, .scale = Scale::kLogarithmic, .harmless = 1e6},
                              [&](double x) { return survives(1 / x); });
    EXPECT_THAT(*down.fails, DoubleNear(1 / at, 0.012 / at));
  }
}

TEST(MarginSearch, NeighboursAreNearBelowTheLimit) {
  const Found linear = Search({.start = 0, .end = 1}, [](double x) { return x < 0.1; });
  const Found decades =
      Search({.start = 0, .end = 1, .scale = Scale::kLogarithmic}, [](double x) { return x < 0.1; });
  for (const auto& [found, is_linear] : {std::pair(linear, true), std::pair(decades, false)}) {
    std::vector<double> below;
    std::copy_if(found.levels.begin(), found.levels.end(), std::back_inserter(below),
                 [&found = found](double level) { return level <= *found.survives; });
    std::sort(below.begin(), below.end());
    EXPECT_GE(below.size(), is_linear ? 33u : 40u);
    for (std::size_t i = 1; i < below.size(); ++i) {
      if (is_linear)
        EXPECT_LE(below[i] - below[i - 1], 0.1 / 32 * 1.06);
      else
        EXPECT_LE(below[i] / below[i - 1], std::pow(10, 1.06 / 8));
    }
  }
}

TEST(MarginSearch, ALevelBeyondTheLimitNeedNotBeJudged) {
  MarginSearch search({.start = 0, .end = 10}, 0.01);
  while (const std::optional<double> level = search.next())
    search.Take(*level > 7 ? std::nullopt : std::optional(*level < 3));
  EXPECT_THAT(*search.fails(), DoubleNear(3, 0.03));
  EXPECT_THAT(search.pockets(), ::testing::IsEmpty());
  MarginSearch below({.start = 0, .end = 10}, 0.01);
  below.Take(true);
  EXPECT_ANY_THROW(below.Take(std::nullopt));
}

// When every frame is replaced, what remains may be harmless, as a constant delay is; six in ten are not.
TEST(MarginSearch, AWholeShareThatIsSurvivedHidesNoPartOfIt) {
  const auto survives = [](double share) { return share < 0.5 || share > 0.9; };
  const Found found = Search({.start = 0, .end = 1, .scale = Scale::kLogarithmic, .harmless = 0.0}, survives);
  ASSERT_TRUE(found.fails);
  EXPECT_THAT(*found.fails, DoubleNear(0.5, 0.005));
}

// A firmware that rejects what is absurd survives a large error, and no moderate one.
TEST(MarginSearch, AnAbsurdLevelThatIsSurvivedHidesNoLimit) {
  const auto rejects = [](double x) { return x < 0.6 || x > 20; };
  const Found linear = Search({.start = 0, .end = 1e6, .harmless = 0.0, .typical = 0.5}, rejects);
  EXPECT_THAT(*linear.fails, DoubleNear(0.6, 0.006));
  const Found noise = Search(
      {.start = 0, .end = 1e6, .scale = Scale::kLogarithmic, .harmless = 0.0, .typical = 0.1}, rejects);
  EXPECT_THAT(*noise.fails, DoubleNear(0.6, 0.006));
}

TEST(MarginSearch, ATypicalLevelMayBeAnywhere) {
  for (const double typical : {-0.5, 0.0, 0.1, 0.5, 7.0}) {
    for (const double start : {0.0, 0.1}) {
      const Found found = Search({.start = start, .end = 1e6, .harmless = 0.0, .typical = typical},
                                 [](double x) { return x < 0.6; });
      EXPECT_THAT(*found.fails, DoubleNear(0.6, 0.006)) << typical << " from " << start;
    }
  }
}

TEST(MarginSearch, TriesWholeNumbersOnly) {
  const Found found = Search({.start = 1, .end = 16, .whole = true}, [](double x) { return x <= 6; });
  EXPECT_EQ(found.survives, 6.0);
  EXPECT_EQ(found.fails, 7.0);
  for (const double level : found.levels) EXPECT_EQ(level, std::round(level));
  const Found few = Search({.start = 0, .end = 3, .whole = true}, [](double x) { return x < 1; });
  EXPECT_EQ(few.fails, 1.0);
}

TEST(MarginSearch, StaysInItsRange) {
  for (const double limit : {1e-7, 0.1, 0.5, 2.0}) {
    const Found found = Search({.start = 0.25, .end = 0.75}, [&](double x) { return x < limit; });
    EXPECT_THAT(found.levels, Each(Ge(0.25)));
    EXPECT_THAT(found.levels, Each(Le(0.75)));
  }
}

TEST(MarginSearch, AFinerToleranceGivesAFinerLimit) {
  const Found found = Search(
      {.start = 0, .end = 10}, [](double x) { return x < M_PI; }, 1e-5);
  EXPECT_LE(*found.fails - *found.survives, 1e-5 * *found.fails);
}

}  // namespace
}  // namespace tiltproof::harness
