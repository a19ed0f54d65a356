// Estimates of what the actuators deliver, from motions whose right answer is known: the firmware's own model moves
// under other inputs than those that the monitor receives.
#include "firmware/tolerant/actuator_monitor.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "firmware/tolerant/controlled_descent.h"

namespace tiltproof::firmware {
namespace {

constexpr Actuators kHover = {.f_r_n = 10.2712F, .f_l_n = 10.2804F, .tau_r_nm = 0, .tau_l_nm = 0};
constexpr Sensors kAloft = {
    .z_m = 1, .pitch_rad = -0.011689F, .alpha_r_rad = 0.011673F, .alpha_l_rad = 0.011615F};

Actuators Commanded(ModelStep step) {
  const auto n = static_cast<float>(step / 3 % 7 - 3);
  return {.f_r_n = kHover.f_r_n + 0.2F * n,
          .f_l_n = kHover.f_l_n - 0.1F * n,
          .tau_r_nm = 4e-4F * n,
          .tau_l_nm = 2e-4F * n * n - 8e-4F};
}

// 20 samples of a vehicle whose actuators are `truth`; each begins from where the vehicle should be, so that it stays
// near hover.
ActuatorMonitor Watch(const ActuatorModel& truth) {
  ActuatorMonitor monitor;
  MotionTimeline timeline;
  timeline.Begin(0, ToMotion(kAloft), kHover);
  for (ModelStep step = 3; step <= 60; step += 3) {
    const Actuators command = Commanded(step);
    timeline.Command(step - 3, command);
    MotionState state = timeline.last_sample();
    for (int i = 0; i < 3; ++i) StepMotion(kTiltrotorConstants, truth.Delivered(command), state, truth.held);
    monitor.Update(timeline, step, state, true);
    timeline.Correct(step, ToMotion(kAloft));
  }
  return monitor;
}

TEST(ActuatorMonitorTest, FindsWhatARotorDelivers) {
  for (const unsigned rotor : {0U, 1U}) {
    for (const float share : {0.4F, 0.7F, 0.85F, 1.3F}) {
      ActuatorModel truth;
      truth.rotor_effectiveness[rotor] = share;
      const ActuatorMonitor monitor = Watch(truth);
      EXPECT_NEAR(monitor.model().rotor_effectiveness[rotor], share, 0.03F);
      EXPECT_NEAR(monitor.model().rotor_effectiveness[1 - rotor], 1, 0.03F);
      EXPECT_EQ(monitor.weak_rotor(rotor), share < 1);
      EXPECT_FALSE(monitor.weak_rotor(1 - rotor));
    }
  }
}

TEST(ActuatorMonitorTest, FindsTheTorqueOfAServo) {
  for (const unsigned servo : {0U, 1U}) {
    for (const float offset_nm : {-0.2F, 0.03F}) {
      ActuatorModel truth;
      truth.servo_offset_nm[servo] = offset_nm;
      const ActuatorMonitor monitor = Watch(truth);
      EXPECT_NEAR(monitor.model().servo_offset_nm[servo], offset_nm,
                  0.05F * (offset_nm < 0 ? -offset_nm : offset_nm));
      EXPECT_EQ(monitor.model().servo_offset_nm[1 - servo], 0);
    }
  }
}

// A servo that keeps its torque looks like one that gives a share of none. Asking for ever more does not move it, and
// would come at once when it lets go.
TEST(ActuatorMonitorTest, AServoThatDoesNotAnswerIsNotAskedForMore) {
  ActuatorMonitor monitor;
  MotionTimeline timeline;
  timeline.Begin(0, ToMotion(kAloft), kHover);
  float most_nm = 0;
  for (ModelStep step = 3; step <= 180; step += 3) {
    Actuators wanted = Commanded(step);
    wanted.tau_r_nm *= 10;  // at most 0.12 N m
    const Actuators command = monitor.acts() ? monitor.model().CommandFor(wanted) : wanted;
    most_nm = std::max({most_nm, command.tau_r_nm, -command.tau_r_nm});
    timeline.Command(step - 3, command);
    Actuators delivered = command;
    delivered.tau_r_nm = 0.02F;
    MotionState state = timeline.last_sample();
    for (int i = 0; i < 3; ++i) StepMotion(kTiltrotorConstants, delivered, state, HeldHinges{});
    monitor.Update(timeline, step, state, true);
    timeline.Correct(step, ToMotion(kAloft));
  }
  EXPECT_FALSE(monitor.acts());
  EXPECT_LT(most_nm, 0.3F);
}

TEST(ActuatorMonitorTest, WhatIsWithinTheSpreadIsHealthy) {
  ActuatorModel truth;
  EXPECT_FALSE(Watch(truth).acts());
  truth.rotor_effectiveness = {0.97F, 1.02F};
  truth.servo_offset_nm = {5e-3F, 0};
  EXPECT_FALSE(Watch(truth).acts());
}

// A rotor that is late, or keeps its thrust, gives what it gave: the command is what moved. No share of it is missing.
TEST(ActuatorMonitorTest, AThrustThatStaysWhileTheCommandMovesIsNoWeakRotor) {
  ActuatorMonitor monitor;
  MotionTimeline timeline;
  timeline.Begin(0, ToMotion(kAloft), kHover);
  for (ModelStep step = 3; step <= 60; step += 3) {
    Actuators command = kHover;
    command.f_r_n *= 1 + 0.003F * static_cast<float>(step);
    timeline.Command(step - 3, command);
    MotionState state = timeline.last_sample();
    for (int i = 0; i < 3; ++i) StepMotion(kTiltrotorConstants, kHover, state, HeldHinges{});
    monitor.Update(timeline, step, state, true);
    timeline.Correct(step, ToMotion(kAloft));
    EXPECT_FALSE(monitor.acts()) << step;
  }
}

// A load weighs on both rotors.
TEST(ActuatorMonitorTest, ALoadIsNoWeakRotor) {
  ActuatorModel truth;
  truth.rotor_effectiveness = {0.85F, 0.85F};
  const ActuatorMonitor monitor = Watch(truth);
  EXPECT_TRUE(monitor.acts());
  EXPECT_FALSE(monitor.weak_rotor(0));
  EXPECT_FALSE(monitor.weak_rotor(1));
}

TEST(ActuatorModelTest, ACommandMakesActuatorsDeliverWhatIsWanted) {
  ActuatorModel actuators;
  EXPECT_EQ(actuators.Delivered(Commanded(3)), Commanded(3));
  actuators.rotor_effectiveness = {0.5F, 1.25F};
  actuators.servo_effectiveness = {0.25F, 1};
  actuators.servo_offset_nm = {0.125F, -0.5F};
  const Actuators wanted = {.f_r_n = 12, .f_l_n = 9, .tau_r_nm = 0.25F, .tau_l_nm = -0.125F};
  EXPECT_TRUE(actuators.CanDeliver(wanted));
  const Actuators delivered = actuators.Delivered(actuators.CommandFor(wanted));
  for (const auto& field : kActuatorFields) {
    EXPECT_NEAR(delivered.*field.in_float, wanted.*field.in_float, 1e-5F) << field.column;
  }
}

TEST(ActuatorModelTest, TheDifferenceOfTheThrustsComesBeforeTheirSum) {
  ActuatorModel actuators;
  actuators.rotor_effectiveness = {0.25F, 1};
  const Actuators wanted = {.f_r_n = 12, .f_l_n = 10, .tau_r_nm = 0, .tau_l_nm = 0};
  EXPECT_TRUE(actuators.LacksThrustFor(wanted));
  EXPECT_FALSE(actuators.CanDeliver(wanted));
  const Actuators delivered = actuators.Delivered(actuators.CommandFor(wanted));
  EXPECT_FLOAT_EQ(delivered.f_r_n, 7.5F);
  EXPECT_FLOAT_EQ(delivered.f_r_n - delivered.f_l_n, 2);
}

TEST(ControlledDescentTest, BeginsAfterHalfASecondWithoutThrustAndSinksSlowly) {
  ControlledDescent descent;
  const Sensors moving = {.x_m = 3, .z_m = 20, .vx_m_s = 1.5F};
  const Reference near = {.x_m = 3, .z_m = 20};
  for (int period = 0; period < 500; ++period) descent.Watch(moving, near, true, period % 2 == 0);
  EXPECT_FALSE(descent.begun());  // as often with as without
  for (int period = 0; period < 500; ++period) descent.Watch(moving, near, false, true);
  EXPECT_FALSE(descent.begun());  // no actuator is faulty
  int periods = 0;
  for (; !descent.begun() && periods < 100; ++periods) descent.Watch(moving, near, true, true);
  EXPECT_NEAR(0.012 * periods, 0.5, 0.02);
  for (int period = 0; period < 1000; ++period) descent.BeginPeriod();  // 12 s
  EXPECT_NEAR(descent.reference().vz_m_s, -ControlledDescent::kSink_m_s, 1e-3F);
  EXPECT_NEAR(descent.reference().vx_m_s, 0, 1e-3F);
  // Braking with 1.5 s takes 1.5 s of its speed, and as much is missing of the sink.
  EXPECT_NEAR(descent.reference().x_m, 3 + 1.5F * 1.5F, 0.05F);
  EXPECT_NEAR(descent.reference().z_m, 20 - 0.5F * (12 - 1.5F), 0.05F);
}

TEST(ControlledDescentTest, BeginsFarFromThePath) {
  ControlledDescent descent;
  const Sensors far = {.x_m = 2, .z_m = 5};
  const Reference path = {.z_m = 5};
  for (int period = 0; period < 160; ++period) descent.Watch(far, path, true, false);
  EXPECT_FALSE(descent.begun());
  for (int period = 0; period < 10; ++period) descent.Watch(far, path, true, false);
  EXPECT_TRUE(descent.begun());
}

}  // namespace
}  // namespace tiltproof::firmware
