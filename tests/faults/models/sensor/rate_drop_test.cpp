#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/faults/one_signal.h"

namespace tiltproof::faults {
namespace {

float HeightAt(std::int64_t n) { return static_cast<float>(n); }

TEST(RateDropTest, KeepsTheFirstSampleOfEachPeriod) {
  const FaultSpec spec =
      At(Spec("sensor.rate_drop", {{"signal", "z_m"}, {"period_ms", 30.0}}), 2 * kPeriod - 1, 12 * kPeriod);
  // True at 0, 36, 60, 96 ms of the window.
  EXPECT_THAT(ReadHeights(spec, 14, HeightAt),
              ::testing::ElementsAre(0, 1, 2, 2, 2, 5, 5, 7, 7, 7, 10, 10, 12, 13));
}

// For any period: sample n is that of the first sample in the same period.
TEST(RateDropTest, HasTheRateThatItSays) {
  for (const std::int64_t period_ms : {5, 12, 13, 50, 1000}) {
    const auto heights = ReadHeights(
        Spec("sensor.rate_drop", {{"signal", "z_m"}, {"period_ms", static_cast<double>(period_ms)}}), 1000,
        HeightAt);
    for (std::int64_t n = 0; n < 1000; ++n) {
      std::int64_t first = n;
      while (first > 0 && (first - 1) * 12 / period_ms == n * 12 / period_ms) --first;
      EXPECT_EQ(heights[static_cast<std::size_t>(n)], HeightAt(first)) << period_ms << " " << n;
    }
  }
}

TEST(RateDropTest, CountsAnewInEachPeriodOfAnIntermittentFault) {
  FaultSpec spec = At(Spec("sensor.rate_drop", {{"signal", "z_m"}, {"period_ms", 1000.0}}), 0);
  spec.period_ns = 4 * kPeriod;
  spec.duty = 0.5;
  EXPECT_THAT(ReadHeights(spec, 9, HeightAt), ::testing::ElementsAre(0, 0, 2, 3, 4, 4, 6, 7, 8));
}

}  // namespace
}  // namespace tiltproof::faults
