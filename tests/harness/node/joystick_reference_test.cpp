#include "harness/node/joystick_reference.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

namespace tiltproof::harness {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr ReferenceTruth kStart{.x_m = 2, .y_m = 0, .z_m = 1, .yaw_rad = 0.5, .vx_m_s = 9};

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
  EXPECT_EQ(reference.value().vx_m_s, 0.0);
  ReferenceTruth r;
  for (int i = 0; i < 1000; ++i)
    r = reference.Step({.vx = 1.0, .vy = -0.5, .vz = 0.25, .yaw_rate = -0.1}, 12 * kNsPerMs);
  EXPECT_NEAR(r.x_m, 2.0 + 2.0 * 12.0, 1e-9);
  EXPECT_NEAR(r.y_m, -1.0 * 12.0, 1e-9);
  EXPECT_NEAR(r.z_m, 1.0 + 0.5 * 12.0, 1e-9);
  EXPECT_NEAR(r.yaw_rad, 0.5 - 0.05 * 12.0, 1e-9);
  EXPECT_DOUBLE_EQ(r.vx_m_s, 2.0);
  EXPECT_DOUBLE_EQ(r.vy_m_s, -1.0);
  EXPECT_DOUBLE_EQ(r.vz_m_s, 0.5);
  r = reference.Step({}, 12 * kNsPerMs);
  EXPECT_NEAR(r.x_m, 26.0, 1e-9);
  EXPECT_EQ(r.vx_m_s, 0.0);
}

TEST(JoystickReference, StaysInItsBox) {
  JoystickReference reference(kStart, {.position_m_min = {-1, -1, 0.5}, .position_m_max = {3, 1, 2}});
  ReferenceTruth r;
  for (int i = 0; i < 2000; ++i) {
    r = reference.Step({1, -1, 1, 1}, 12 * kNsPerMs);
    EXPECT_LE(r.x_m, 3.0);
    EXPECT_GE(r.y_m, -1.0);
    EXPECT_LE(r.z_m, 2.0);
  }
  EXPECT_EQ(r.x_m, 3.0);
  EXPECT_EQ(r.vx_m_s, 0.0);  // it stands at the wall, and does not pretend to go on
  EXPECT_LT(r.yaw_rad, std::numbers::pi);
  r = reference.Step({.vx = -1}, 12 * kNsPerMs);
  EXPECT_LT(r.x_m, 3.0);
  EXPECT_EQ(r.vx_m_s, -1.0);
  // A start outside is no reason to jump.
  JoystickReference outside({.x_m = 100, .z_m = 0.2}, {});
  EXPECT_EQ(outside.Step({}, kNsPerMs).x_m, 100.0);
  EXPECT_EQ(outside.Step({}, kNsPerMs).z_m, 0.2);
}

TEST(JoystickReference, LongAndBackwardStepsDoNotMakeItJump) {
  JoystickReference reference(kStart, {});
  EXPECT_EQ(reference.Step({.vx = 1}, -kNsPerS).x_m, 2.0);
  EXPECT_NEAR(reference.Step({.vx = 1}, 3600 * kNsPerS).x_m, 2.1, 1e-12);
  EXPECT_EQ(reference.Step({.vx = kNan}, kNsPerMs).vx_m_s, 0.0);
}

TEST(JoystickReference, RefusesLimitsThatMeanNothing) {
  EXPECT_THROW(JoystickReference(kStart, {.speed_m_s_max = -1}), std::invalid_argument);
  EXPECT_THROW(JoystickReference(kStart, {.speed_m_s_max = kNan}), std::invalid_argument);
  EXPECT_THROW(JoystickReference(kStart, {.dead_zone = 1}), std::invalid_argument);
  EXPECT_THROW(JoystickReference(kStart, {.position_m_min = {60, 0, 0}}), std::invalid_argument);
  EXPECT_THROW(JoystickReference(kStart, {.position_m_min = {kNan, 0, 0}}), std::invalid_argument);
  EXPECT_THROW(JoystickReference({.x_m = kNan}, {}), std::invalid_argument);
}

}  // namespace
}  // namespace tiltproof::harness
