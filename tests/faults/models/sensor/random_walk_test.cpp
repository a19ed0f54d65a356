#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/faults/goodness_of_fit.h"
#include "tests/faults/one_signal.h"

namespace tiltproof::faults {
namespace {

// 100 000 steps, of samples that are 12 and 24 ms apart in turns.
TEST(RandomWalkTest, StepsAreNormalWithTheRootOfTheTime) {
  constexpr int kSamples = 100'001;
  constexpr double kDensity = 0.25;
  FaultSchedule schedule =
      AtThePlant({Spec("sensor.random_walk", {{"signal", "z_m"}, {"density", kDensity}})}, 4);
  std::vector<double> steps;
  double before = 0;
  TimeNs t = 0;
  for (int n = 0; n < kSamples; ++n) {
    const TimeNs since_ns = (n % 2 + 1) * kPeriod;
    if (n > 0) t += since_ns;
    Sensors sensors;
    EditSensors(schedule, t, sensors);
    const auto error = static_cast<double>(sensors.z_m);
    if (n == 0)
      EXPECT_EQ(error, 0);
    else
      steps.push_back((error - before) / (kDensity * std::sqrt(ToSeconds(since_ns))));
    before = error;
  }
  EXPECT_LT(KolmogorovStatistic(steps, NormalCdf), kKolmogorovCritical);
  EXPECT_LT(std::abs(CorrelationOfNeighbours(steps)), 4 / std::sqrt(steps.size()));
}

// 2000 seeds: the variance of a normal distribution is known to within 4 sqrt(2 / 2000) = 13 %.
TEST(RandomWalkTest, AfterOneSecondItsDeviationIsTheDensity) {
  double squares = 0;
  for (std::uint64_t seed = 0; seed < 2000; ++seed) {
    const auto heights = ReadHeights(
        Spec("sensor.random_walk", {{"signal", "z_m"}, {"density", 0.5}}), 85,
        [](std::int64_t) { return 0.0F; }, seed);
    squares += static_cast<double>(heights.back()) * static_cast<double>(heights.back());  // at 1.008 s
  }
  EXPECT_NEAR(squares / 2000 / (0.25 * 1.008), 1, 0.13);
}

TEST(RandomWalkTest, EachPeriodBeginsAtZeroAndSamplesLeftOutGoOn) {
  FaultSpec spec = At(Spec("sensor.random_walk", {{"signal", "z_m"}, {"density", 1.0}}), 0);
  const auto truth = [](std::int64_t) { return 0.0F; };
  spec.period_ns = 8 * kPeriod;
  spec.duty = 0.5;
  const auto all = ReadHeights(spec, 16, truth);
  EXPECT_EQ(all[0], 0);
  EXPECT_NE(all[3], 0);
  EXPECT_EQ(all[4], 0);
  EXPECT_EQ(all[8], 0);
  EXPECT_NE(all[9], 0);
  EXPECT_NE(all[9], all[1]);
  spec.every_nth_count = 2;
  const auto some = ReadHeights(spec, 4, truth);
  EXPECT_TRUE(some[2] == 0 || some[2] == all[2]);
  EXPECT_TRUE(some[3] == 0 || some[3] == all[3]);
  EXPECT_NE(some[2] == 0, some[3] == 0);
}

}  // namespace
}  // namespace tiltproof::faults
