#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "tests/faults/goodness_of_fit.h"
#include "tests/faults/one_signal.h"

namespace tiltproof::faults {
namespace {

FaultSpec Spike(double magnitude, double rate_hz) {
  return Spec("sensor.spike", {{"signal", "z_m"}, {"magnitude", magnitude}, {"rate_hz", rate_hz}});
}

// 200 000 samples in blocks of ten: the number of hits in each is binomial, with the probability that a Poisson
// process has an event within 12 ms.
TEST(SpikeTest, SamplesAreHitAsByAPoissonProcess) {
  constexpr double kRate_hz = 20;
  constexpr std::size_t kSamples = 200'001, kBlock = 10, kMost = 6;  // the last cell has all above
  const auto heights = ReadHeights(
      Spike(3, kRate_hz), kSamples, [](std::int64_t) { return 10.0F; }, 5);
  EXPECT_EQ(heights[0], 10);  // no sample before it
  std::vector<double> observed(kMost + 1), expected(kMost + 1);
  double up = 0, down = 0;
  for (std::size_t first = 1; first < kSamples; first += kBlock) {
    std::size_t hits = 0;
    for (std::size_t n = first; n < first + kBlock; ++n) {
      EXPECT_TRUE(heights[n] == 7 || heights[n] == 10 || heights[n] == 13);
      hits += heights[n] != 10 ? 1 : 0;
      up += heights[n] == 13 ? 1 : 0;
      down += heights[n] == 7 ? 1 : 0;
    }
    ++observed[std::min(hits, kMost)];
  }
  const double p = 1 - std::exp(-kRate_hz * 0.012);
  double combinations = 1, rest = 1;
  for (std::size_t k = 0; k < kMost; ++k) {
    const double probability = combinations * std::pow(p, k) * std::pow(1 - p, kBlock - k);
    expected[k] = probability * (kSamples - 1) / kBlock;
    rest -= probability;
    combinations *= static_cast<double>(kBlock - k) / static_cast<double>(k + 1);
  }
  expected[kMost] = rest * (kSamples - 1) / kBlock;
  EXPECT_LT(ChiSquareStatistic(observed, expected), 22.46);  // 6 degrees of freedom, 0.999
  EXPECT_LT(std::abs(up - down), 4 * std::sqrt(up + down));
}

// Spikes come in time: half as many samples are hit by nearly as many.
TEST(SpikeTest, TheRateIsOfTimeNotOfSamples) {
  const auto hits = [](std::int64_t samples, TimeNs period_ns) {
    FaultSchedule schedule = AtThePlant({Spike(1, 2)}, 6);
    int count = 0;
    for (std::int64_t n = 0; n < samples; ++n) {
      Sensors sensors;
      EditSensors(schedule, n * period_ns, sensors);
      if (sensors.z_m != 0) ++count;
    }
    return count;
  };
  const int fine = hits(100'000, 10 * kNsPerMs), coarse = hits(50'000, 20 * kNsPerMs);  // 1000 s
  EXPECT_NEAR(fine, 1e5 * (1 - std::exp(-0.02)), 4 * std::sqrt(2000));
  EXPECT_NEAR(coarse, 5e4 * (1 - std::exp(-0.04)), 4 * std::sqrt(2000));
  EXPECT_NEAR(coarse, fine, 80);  // the same spikes, a few of which share a sample
}

}  // namespace
}  // namespace tiltproof::faults
