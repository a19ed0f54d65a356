#include "harness/node/joystick_reference.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

namespace tiltproof::harness {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr ReferencePoint kStart{.position_m = {2, 0, 1}, .yaw_rad = 0.5, .velocity_m_s = {9, 0, 0}};

TEST(DeadZone, IsContinuousOddAndReachesTheEnds) {
  EXPECT_EQ(ApplyDeadZone(0.1, 0.1), 0.0);
  EXPECT_NEAR(ApplyDeadZone(0.1 + 1e-9, 0.1), 0.0, 1e-8);
  EXPECT_DOUBLE_EQ(ApplyDeadZone(0.55, 0.1), 0.5);
  EXPECT_DOUBLE_EQ(ApplyDeadZone(1.0, 0.1), 1.0);
  EXPECT_DOUBLE_EQ(ApplyDeadZone(7.0, 0.1), 1.0);
  EXPECT_EQ(ApplyDeadZone(kNan, 0.1), 0.0);
  double before = -1.0;
  for (int i = -1000; i <= 1000; ++i) {
    const double value = ApplyDeadZone(i / 1000.0, 0.2);
    EXPECT_DOUBLE_EQ(value, -ApplyDeadZone(-i / 1000.0, 0.2));
    EXPECT_GE(value, before);
    EXPECT_LE(value - before, 0.001 / 0.8 + 1e-12);
    EXPECT_DOUBLE_EQ(ApplyDeadZone(i / 1000.0, 0.0), i / 1000.0);
    before = value;
  }
}

TEST(JoystickReference, CoversSpeedTimesTime) {
  JoystickReference reference(kStart, {.speed_m_s_max = 2.0, .dead_zone = 0.0});
  EXPECT_EQ(reference.value().velocity_m_s[0], 0.0);
  ReferencePoint r;
  for (int i = 0; i < 1000; ++i)
    r = reference.Step({.vx = 1.0, .vy = -0.5, .vz = 0.25, .yaw_rate = -0.1}, 12 * kNsPerMs);
  EXPECT_NEAR(r.position_m[0], 2.0 + 2.0 * 12.0, 1e-9);
  EXPECT_NEAR(r.position_m[1], -1.0 * 12.0, 1e-9);
  EXPECT_NEAR(r.position_m[2], 1.0 + 0.5 * 12.0, 1e-9);
  EXPECT_NEAR(r.yaw_rad, 0.5 - 0.05 * 12.0, 1e-9);
  EXPECT_DOUBLE_EQ(r.velocity_m_s[0], 2.0);
  EXPECT_DOUBLE_EQ(r.velocity_m_s[1], -1.0);
  EXPECT_DOUBLE_EQ(r.velocity_m_s[2], 0.5);
  r = reference.Step({}, 12 * kNsPerMs);
  EXPECT_NEAR(r.position_m[0], 26.0, 1e-9);
  EXPECT_EQ(r.velocity_m_s[0], 0.0);
}

TEST(JoystickReference, StaysInItsBox) {
  JoystickReference reference(kStart, {.position_m_min = {-1, -1, 0.5}, .position_m_max = {3, 1, 2}});
  ReferencePoint r;
  for (int i = 0; i < 2000; ++i) {
    r = reference.Step({1, -1, 1, 1}, 12 * kNsPerMs);
    EXPECT_LE(r.position_m[0], 3.0);
    EXPECT_GE(r.position_m[1], -1.0);
    EXPECT_LE(r.position_m[2], 2.0);
  }
  EXPECT_EQ(r.position_m[0], 3.0);
  EXPECT_EQ(r.velocity_m_s[0], 0.0);  // it stands at the wall, and does not pretend to go on
  EXPECT_LT(r.yaw_rad, std::numbers::pi);
  r = reference.Step({.vx = -1}, 12 * kNsPerMs);
  EXPECT_LT(r.position_m[0], 3.0);
  EXPECT_EQ(r.velocity_m_s[0], -1.0);
  // A start outside is no reason to jump.
  JoystickReference outside({.position_m = {100, 0, 0.2}}, {});
  EXPECT_EQ(outside.Step({}, kNsPerMs).position_m[0], 100.0);
  EXPECT_EQ(outside.Step({}, kNsPerMs).position_m[2], 0.2);
}

TEST(JoystickReference, LongAndBackwardStepsDoNotMakeItJump) {
  JoystickReference reference(kStart, {});
  EXPECT_EQ(reference.Step({.vx = 1}, -kNsPerS).position_m[0], 2.0);
  EXPECT_NEAR(reference.Step({.vx = 1}, 3600 * kNsPerS).position_m[0], 2.1, 1e-12);
  EXPECT_EQ(reference.Step({.vx = kNan}, kNsPerMs).velocity_m_s[0], 0.0);
}

TEST(JoystickReference, RefusesLimitsThatMeanNothing) {
  EXPECT_THROW(JoystickReference(kStart, {.speed_m_s_max = -1}), std::invalid_argument);
  EXPECT_THROW(JoystickReference(kStart, {.speed_m_s_max = kNan}), std::invalid_argument);
  EXPECT_THROW(JoystickReference(kStart, {.dead_zone = 1}), std::invalid_argument);
  EXPECT_THROW(JoystickReference(kStart, {.position_m_min = {60, 0, 0}}), std::invalid_argument);
  EXPECT_THROW(JoystickReference(kStart, {.position_m_min = {kNan, 0, 0}}), std::invalid_argument);
  EXPECT_THROW(JoystickReference({.position_m = {kNan, 0, 0}}, {}), std::invalid_argument);
}

}  // namespace
}  // namespace tiltproof::harness
