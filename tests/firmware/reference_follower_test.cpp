// References that jump, stay away or are alone in what they say; the paths are known in closed form.
#include "firmware/reference_follower.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tiltproof::firmware {
namespace {

constexpr double kReferencePeriod_s = 0.012;

Reference Spiral(int period, bool velocity = true) {
  const double angle = 0.314 * kReferencePeriod_s * period;
  return {.x_m = static_cast<float>(5 * std::cos(angle)),
          .y_m = static_cast<float>(5 * std::sin(angle)),
          .z_m = static_cast<float>(kReferencePeriod_s * period / 6),
          .yaw_rad = 0.1F,
          .vx_m_s = velocity ? static_cast<float>(-1.57 * std::sin(angle)) : 0,
          .vy_m_s = velocity ? static_cast<float>(1.57 * std::cos(angle)) : 0,
          .vz_m_s = velocity ? 1.0F / 6 : 0};
}

double Distance(const Reference& a, const Reference& b) {
  return std::hypot(a.x_m - b.x_m, a.y_m - b.y_m, a.z_m - b.z_m);
}

TEST(ReferenceFollowerTest, GoodReferencesPassWithTheirBits) {
  for (const bool velocity : {true, false}) {
    ReferenceFollower follower({.x_m = 4});
    for (int period = 0; period < 1000; ++period) {
      follower.BeginPeriod();
      follower.Receive(Spiral(period, velocity));
      EXPECT_EQ(follower.Flown(), Spiral(period, velocity));
      EXPECT_TRUE(follower.follows());
    }
  }
}

TEST(ReferenceFollowerTest, OneThatSaysSomethingElseIsNotFlown) {
  ReferenceFollower follower(Spiral(0));
  for (int period = 0; period < 500; ++period) {
    follower.BeginPeriod();
    Reference received = Spiral(period);
    if (period % 10 == 9) received.y_m += 4;
    if (period % 10 == 4) received.vx_m_s = 300;
    follower.Receive(received);
    EXPECT_LT(Distance(follower.Flown(), Spiral(period)), 0.025) << period;
    EXPECT_LT(std::abs(follower.Flown().vx_m_s), 2);
  }
}

TEST(ReferenceFollowerTest, AStepIsBelievedAfterFourAndApproachedAtASpeedThatAVehicleCanFly) {
  const Reference before = {.x_m = 1, .z_m = 2, .yaw_rad = 0.2F};
  const Reference after = {.x_m = 4, .y_m = -2, .z_m = 2, .yaw_rad = -0.4F};
  ReferenceFollower follower(before);
  follower.Receive(before);
  Reference last = before;
  int reached = 0;
  for (int period = 1; period < 400; ++period) {
    follower.BeginPeriod();
    follower.Receive(after);
    const Reference flown = follower.Flown();
    if (period < 4) {
      EXPECT_EQ(flown, before);
    }
    for (const auto field : {&Reference::x_m, &Reference::y_m, &Reference::z_m})
      EXPECT_LE(std::abs(flown.*field - last.*field), 1.0 * kReferencePeriod_s + 1e-6);
    EXPECT_LE(std::abs(flown.yaw_rad - last.yaw_rad), 0.5 * kReferencePeriod_s + 1e-6);
    if (reached == 0 && flown == after) reached = period;
    last = flown;
  }
  EXPECT_NEAR(reached * kReferencePeriod_s, 3.0, 0.1);  // 3 m
  EXPECT_TRUE(follower.follows());
}

TEST(ReferenceFollowerTest, WhenNoneComesItGoesOnForAWhileAndThenStays) {
  ReferenceFollower follower(Spiral(0));
  follower.Receive({.x_m = 1, .vx_m_s = 2});
  for (int period = 1; period < 500; ++period) {
    follower.BeginPeriod();
    const double time_s = kReferencePeriod_s * period;
    const Reference flown = follower.Flown();
    if (time_s < 1.1) {
      EXPECT_NEAR(flown.x_m, 1 + 2 * time_s, 0.05) << period;
    }
    if (time_s > 1.3) {
      EXPECT_NEAR(flown.x_m, 1 + 2 * 1.2, 0.01) << period;
      EXPECT_EQ(flown.vx_m_s, 0);
    }
  }
  EXPECT_FALSE(follower.follows());
}

TEST(ReferenceFollowerTest, WaitingForTheFirstIsNotHolding) {
  ReferenceFollower follower({.x_m = 4});
  for (int period = 0; period < 100; ++period) follower.BeginPeriod();
  EXPECT_TRUE(follower.follows());
  EXPECT_EQ(follower.Flown(), (Reference{.x_m = 4}));
  follower.Receive(Spiral(0));
  EXPECT_EQ(follower.Flown(), Spiral(0));
}

// pi and -pi are one heading, however it is written.
TEST(ReferenceFollowerTest, AYawThatPassesPiIsNoJump) {
  constexpr double kPi = 3.14159265358979;
  for (const double yaw_rate_rad_s : {0.5, -0.5}) {
    ReferenceFollower follower({.x_m = 4});
    for (int period = 0; period < 1000; ++period) {
      const double yaw = kPi + yaw_rate_rad_s * kReferencePeriod_s * (period - 500);
      Reference reference = Spiral(period);
      reference.yaw_rad = static_cast<float>(std::remainder(yaw, 2 * kPi));
      follower.BeginPeriod();
      follower.Receive(reference);
      ASSERT_EQ(follower.Flown(), reference) << period;
      ASSERT_TRUE(follower.follows()) << period;
    }
  }
}

// The vehicle turns from one to the other through pi, by 0.2 rad and not by 6.1.
TEST(ReferenceFollowerTest, AStepOfYawAcrossPiIsApproachedTheShortWay) {
  const Reference before = {.x_m = 1, .z_m = 2, .yaw_rad = 3.04F};
  const Reference after = {.x_m = 1, .z_m = 2, .yaw_rad = -3.04F};
  ReferenceFollower follower(before);
  follower.Receive(before);
  int reached = 0;
  for (int period = 1; period < 400; ++period) {
    follower.BeginPeriod();
    follower.Receive(after);
    const double from_pi = std::remainder(follower.Flown().yaw_rad - 3.14159265358979, 6.28318530717959);
    ASSERT_LT(std::abs(from_pi), 0.11) << period;
    if (reached == 0 && follower.Flown() == after) reached = period;
  }
  EXPECT_NEAR(reached * kReferencePeriod_s, 0.2032 / 0.5, 0.1);
}

}  // namespace
}  // namespace tiltproof::firmware
