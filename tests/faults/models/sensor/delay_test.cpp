#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "tests/faults/one_signal.h"

namespace tiltproof::faults {
namespace {

FaultSpec LateBy(double delay_ms) {
  return Spec("sensor.delay", {{"signal", "z_m"}, {"delay_ms", delay_ms}});
}

float WavingHeight(std::int64_t n) { return 3 * std::sin(0.1F * static_cast<float>(n)); }

TEST(SensorDelayTest, IsACopyShiftedByWholeSamples) {
  for (const auto& [delay_ms, samples] : std::vector<std::pair<double, std::int64_t>>{
           {1, 1}, {12, 1}, {12.001, 2}, {20, 2}, {24, 2}, {1200, 100}, {10'000, 834}}) {
    const auto heights = ReadHeights(LateBy(delay_ms), 1000, WavingHeight);
    for (std::int64_t n = 0; n < 1000; ++n)
      ASSERT_EQ(heights[static_cast<std::size_t>(n)], WavingHeight(std::max<std::int64_t>(0, n - samples)))
          << delay_ms << " " << n;
  }
}

TEST(SensorDelayTest, ReadsWhatWasBeforeTheWindow) {
  const auto heights = ReadHeights(At(LateBy(36), 5 * kPeriod, 8 * kPeriod), 10, WavingHeight);
  for (std::int64_t n = 0; n < 10; ++n)
    EXPECT_EQ(heights[static_cast<std::size_t>(n)], WavingHeight(n >= 5 && n < 8 ? n - 3 : n)) << n;
}

}  // namespace
}  // namespace tiltproof::faults
