#include <gtest/gtest.h>

#include <algorithm>
#include <array>

#include "tests/faults/one_signal.h"

namespace tiltproof::faults {
namespace {

// The middle one of three.
float Middle(float a, float b, float c) {
  std::array<float, 3> all = {a, b, c};
  std::sort(all.begin(), all.end());
  return all[1];
}

TEST(SaturateTest, ReadsNoMoreThanTheLimitEitherWay) {
  for (const double limit : {0.0, 2.3, 40.0}) {
    const auto truth = [](std::int64_t n) { return 0.37F * static_cast<float>(n - 50); };
    const auto heights =
        ReadHeights(Spec("sensor.saturate", {{"signal", "z_m"}, {"limit", limit}}), 100, truth);
    const auto end = static_cast<float>(limit);
    for (std::size_t n = 0; n < heights.size(); ++n)
      EXPECT_EQ(heights[n], Middle(-end, truth(static_cast<std::int64_t>(n)), end)) << n;
  }
}

}  // namespace
}  // namespace tiltproof::faults
