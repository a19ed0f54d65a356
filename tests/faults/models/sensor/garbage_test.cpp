#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <vector>

#include "tests/faults/goodness_of_fit.h"
#include "tests/faults/one_signal.h"

namespace tiltproof::faults {
namespace {

FaultSpec Garbage(double probability) {
  return Spec("sensor.garbage", {{"signal", "z_m"}, {"probability", probability}});
}

TEST(GarbageTest, EachByteOfAReadingIsUniform) {
  constexpr std::int64_t kSamples = 100'000;
  const auto heights = ReadHeights(
      Garbage(1), kSamples, [](std::int64_t) { return 1.0F; }, 3);
  const std::vector<double> expected(256, kSamples / 256.0);
  for (int shift = 0; shift < 32; shift += 8) {
    std::vector<double> observed(256);
    for (const float height : heights) ++observed[std::bit_cast<std::uint32_t>(height) >> shift & 0xFF];
    EXPECT_LT(ChiSquareStatistic(observed, expected), 330.5) << shift;  // 255 degrees of freedom, 0.999
  }
}

TEST(GarbageTest, ReplacesWithItsProbability) {
  constexpr std::int64_t kSamples = 100'000;
  const auto heights = ReadHeights(Garbage(0.2), kSamples, [](std::int64_t) { return 1.0F; });
  const auto replaced = kSamples - std::count(heights.begin(), heights.end(), 1.0F);
  EXPECT_NEAR(static_cast<double>(replaced) / kSamples, 0.2, 4 * std::sqrt(0.2 * 0.8 / kSamples));
}

}  // namespace
}  // namespace tiltproof::faults
