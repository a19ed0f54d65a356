// The firmware's polynomials against <cmath> in binary64.
#include "firmware/trigonometry.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

namespace tiltproof::firmware {
namespace {

TEST(TrigonometryTest, SineAndCosineAreThoseOfCmath) {
  for (int i = -100'000; i <= 100'000; ++i) {
    const float angle_rad = 1e-3F * static_cast<float>(i);
    const SineCosine computed = ComputeSineCosine(angle_rad);
    ASSERT_NEAR(computed.sine, std::sin(static_cast<double>(angle_rad)), 2e-7) << angle_rad;
    ASSERT_NEAR(computed.cosine, std::cos(static_cast<double>(angle_rad)), 2e-7) << angle_rad;
  }
}

TEST(TrigonometryTest, SmallAnglesKeepTheirRelativePrecision) {
  for (float angle_rad = 1e-20F; angle_rad < 0.1F; angle_rad *= 1.7F) {
    ASSERT_NEAR(ComputeSineCosine(angle_rad).sine / std::sin(angle_rad), 1, 2e-7) << angle_rad;
  }
}

TEST(TrigonometryTest, TheArcTangentIsThatOfCmathInAllQuadrants) {
  for (int i = -31'415; i <= 31'415; ++i) {
    const double angle_rad = 1e-4 * i;
    for (const double radius : {1e-6, 1.0, 1e6}) {
      const auto x = static_cast<float>(radius * std::cos(angle_rad));
      const auto y = static_cast<float>(radius * std::sin(angle_rad));
      ASSERT_NEAR(ArcTangent(y, x), std::atan2(static_cast<double>(y), static_cast<double>(x)), 4e-7)
          << angle_rad;
    }
  }
  EXPECT_EQ(ArcTangent(0, 0), 0);
  EXPECT_EQ(ArcTangent(0, 1), 0);
  EXPECT_FLOAT_EQ(ArcTangent(0, -1), kPi);
  EXPECT_FLOAT_EQ(ArcTangent(1, 0), kPi / 2);
  EXPECT_FLOAT_EQ(ArcTangent(-1, 0), -kPi / 2);
}

TEST(TrigonometryTest, WrapsIntoOneTurn) {
  for (int i = -1000; i <= 1000; ++i) {
    const float angle_rad = 0.1F * static_cast<float>(i);
    const float wrapped_rad = WrapAngle(angle_rad);
    ASSERT_GT(wrapped_rad, -kPi);
    ASSERT_LE(wrapped_rad, kPi);
    ASSERT_NEAR(std::remainder(static_cast<double>(wrapped_rad - angle_rad), 2 * std::numbers::pi), 0, 2e-5);
  }
}

// Numbers that are no angle have a defined result, in a bounded time.
TEST(TrigonometryTest, TakesAnyNumber) {
  using Limits = std::numeric_limits<float>;
  for (const float value :
       {Limits::quiet_NaN(), Limits::infinity(), -Limits::infinity(), Limits::max(), 1e20F}) {
    ComputeSineCosine(value);
    ComputeSineCosine(-value);
    EXPECT_EQ(WrapAngle(value), 0);
    EXPECT_EQ(WrapAngle(-value), 0);
  }
}

}  // namespace
}  // namespace tiltproof::firmware
