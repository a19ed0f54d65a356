#include <gtest/gtest.h>

#include "tests/faults/one_signal.h"

namespace tiltproof::faults {
namespace {

TEST(ScaleTest, MultipliesTheTrueValue) {
  for (const double factor : {0.001, 0.75, 1.25, 1000.0}) {
    const auto heights = ReadHeights(Spec("sensor.scale", {{"signal", "z_m"}, {"factor", factor}}), 100,
                                     [](std::int64_t n) { return 0.5F * static_cast<float>(n - 50); });
    for (std::size_t n = 0; n < heights.size(); ++n)
      EXPECT_FLOAT_EQ(heights[n], static_cast<float>((static_cast<double>(n) - 50) / 2 * factor));
  }
}

}  // namespace
}  // namespace tiltproof::faults
