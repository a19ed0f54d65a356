#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/faults/one_signal.h"

namespace tiltproof::faults {
namespace {

FaultSpec Quantise(double step) { return Spec("sensor.quantise", {{"signal", "z_m"}, {"step", step}}); }

TEST(QuantiseTest, RoundsToTheNearestMultiple) {
  for (const double step : {0.25, 0.1, 3.0}) {
    const auto truth = [](std::int64_t n) { return 0.0371F * static_cast<float>(n - 500); };
    const auto heights = ReadHeights(Quantise(step), 1000, truth);
    for (std::size_t n = 0; n < heights.size(); ++n) {
      const auto exact = static_cast<double>(truth(static_cast<std::int64_t>(n)));
      EXPECT_EQ(heights[n], static_cast<float>(std::nearbyint(exact / step) * step)) << exact;
      EXPECT_LE(std::abs(static_cast<double>(heights[n]) - exact), step / 2 * (1 + 1e-6));
    }
  }
}

TEST(QuantiseTest, BetweenTwoItReadsTheUpperOne) {
  const auto truth = [](std::int64_t n) { return 0.5F * static_cast<float>(n - 3); };
  EXPECT_THAT(ReadHeights(Quantise(1), 7, truth), ::testing::ElementsAre(-1, -1, 0, 0, 1, 1, 2));
}

TEST(QuantiseTest, AStepFarBelowTheResolutionChangesNothing) {
  EXPECT_THAT(ReadHeights(Quantise(1e-300), 1, [](std::int64_t) { return 3.7F; }),
              ::testing::ElementsAre(3.7F));
}

}  // namespace
}  // namespace tiltproof::faults
