#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/faults/one_signal.h"

namespace tiltproof::faults {
namespace {

TEST(DriftTest, GrowsFromTheFirstSampleOfTheWindow) {
  FaultSpec spec =
      At(Spec("sensor.drift", {{"signal", "z_m"}, {"rate_per_s", -2.5}}), 10 * kPeriod - 1, 90 * kPeriod);
  const auto heights = ReadHeights(spec, 100, [](std::int64_t n) { return static_cast<float>(n); });
  for (std::int64_t n = 0; n < 100; ++n) {
    const double error = n < 10 || n >= 90 ? 0 : -0.03 * static_cast<double>(n - 10);
    EXPECT_FLOAT_EQ(heights[static_cast<std::size_t>(n)], static_cast<float>(static_cast<double>(n) + error));
  }
}

TEST(DriftTest, BeginsAnewInEachPeriodAndSamplesLeftOutCount) {
  FaultSpec spec = At(Spec("sensor.drift", {{"signal", "z_m"}, {"rate_per_s", 1000.0}}), 0);
  spec.period_ns = 5 * kPeriod;
  spec.duty = 0.8;
  spec.every_nth_count = 2;
  // The trigger picks the second and fourth sample of each period.
  EXPECT_THAT(ReadHeights(spec, 10, [](std::int64_t) { return 0.0F; }),
              ::testing::ElementsAre(0, 12, 0, 36, 0, 0, 12, 0, 36, 0));
}

}  // namespace
}  // namespace tiltproof::faults
