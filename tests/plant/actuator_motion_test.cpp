// The lag of rotors, position servos, and stops that hold at any step.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "plant/dynamics.h"
#include "plant/plant.h"
#include "tests/plant/models.h"
#include "tests/plant/rotor_vehicles.h"
#include "tests/support/newton_euler_model.h"

namespace tiltproof::plant {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

std::vector<double> StateOf(const Plant& plant, const VehicleModel& model) {
  std::vector<double> state(model.signals().states.size());
  plant.State(state);
  return state;
}

VehicleModel LaggingQuadrotor() {
  VehicleModel model = Quadrotor({0, 0, 0});
  for (Rotor& rotor : model.rotors) {
    rotor.time_constant_up_s = 0.05;
    rotor.time_constant_down_s = 0.2;
  }
  return model;
}

TEST(RotorLag, FollowsItsExponentialUpAndDown) {
  const VehicleModel model = LaggingQuadrotor();
  for (const TimeNs step_ns : {kNsPerMs, 4 * kNsPerMs}) {
    Plant plant(model, {.step_ns = step_ns, .ground = false});
    const double hover_n = model.HoverInput()[0];
    std::vector<double> command = model.HoverInput(), in_force;
    command[1] = 20;  // beyond its limit of 10 N
    command[2] = 1;
    for (int i = 1; i <= 20; ++i) {
      in_force = command;
      plant.InputInForce(in_force);
      const double t_s = i * ToSeconds(step_ns);
      EXPECT_NEAR(in_force[0], hover_n, 1e-12);
      EXPECT_NEAR(in_force[1], 10 + (hover_n - 10) * std::exp(-t_s / 0.05), 1e-12);
      EXPECT_NEAR(in_force[2], 1 + (hover_n - 1) * std::exp(-t_s / 0.2), 1e-12);
      plant.Step(command);
    }
  }
}

// The vertical acceleration is that of the thrusts in force.
TEST(RotorLag, TheThrustInForceMovesTheVehicle) {
  const VehicleModel model = LaggingQuadrotor();
  Plant plant(model, {});
  plant.Reset({0, 0, 50}, {0, 0, 0});
  const std::vector<double> command(4, 5.0);
  double vz_m_s = 0;
  for (int i = 0; i < 100; ++i) {
    std::vector<double> in_force = command;
    plant.InputInForce(in_force);
    vz_m_s += 0.004 * (4 * in_force[0] / 1.2 - kG_m_s2);
    plant.Step(command);
    ASSERT_NEAR(StateOf(plant, model)[8], vz_m_s, 1e-9) << i;
  }
  // Reset puts the hover in force again.
  plant.Reset({0, 0, 50}, {0, 0, 0});
  std::vector<double> in_force = model.HoverInput();
  plant.InputInForce(in_force);
  EXPECT_EQ(in_force, model.HoverInput());
}

TEST(RotorLag, ACommandThatIsNotANumberIsAnEventUntilReset) {
  const VehicleModel model = LaggingQuadrotor();
  Plant plant(model, {});
  plant.Step({{std::numeric_limits<double>::quiet_NaN(), 1, 1, 1}});
  EXPECT_EQ(plant.Event(), FlightEvent::kNotFinite);
  plant.Reset({0, 0, 5}, {0, 0, 0});
  plant.Step(model.HoverInput());
  EXPECT_EQ(plant.Event(), FlightEvent::kNone);
}

// The far part of the way at the largest speed, the rest exponentially: this is the solution of
// alpha' = clamp((u - alpha) / T, -speed, speed).
double ServoAngle(double from, double to, double lag_s, double speed_rad_s, double t_s) {
  const double way = std::abs(to - from), near = speed_rad_s * lag_s;
  const double sign = to > from ? 1 : -1;
  if (way <= near) return to - sign * way * std::exp(-t_s / lag_s);
  const double turning_s = (way - near) / speed_rad_s;
  if (t_s <= turning_s) return from + sign * speed_rad_s * t_s;
  return to - sign * near * std::exp(-(t_s - turning_s) / lag_s);
}

TEST(PositionServo, FollowsItsCommandWithLagAndLargestSpeed) {
  VehicleModel model = TailTricopter(ServoMode::kPosition);
  EXPECT_EQ(model.signals().inputs[3].name, "angle_tail_rad");
  EXPECT_EQ(model.signals().inputs[3].min, -1);
  EXPECT_EQ(model.signals().inputs[3].max, 1);
  for (const auto& [lag_s, speed_rad_s] : {std::pair{0.04, 6.0}, {0.0, 3.0}, {0.1, 100.0}}) {
    model.hinges[0].time_constant_s = lag_s;
    model.hinges[0].speed_max_rad_s = speed_rad_s;
    Plant plant(model, {.ground = false});
    std::vector<double> command = model.HoverInput();
    const double from = StateOf(plant, model)[6];
    command[3] = 0.8;
    for (int i = 1; i <= 100; ++i) {
      plant.Step(command);
      const double expected = lag_s > 0 ? ServoAngle(from, 0.8, lag_s, speed_rad_s, 0.004 * i)
                                        : std::min(0.8, from + speed_rad_s * 0.004 * i);
      ASSERT_NEAR(StateOf(plant, model)[6], expected, 1e-4) << lag_s << ' ' << i;
    }
  }
}

TEST(PositionServo, WithoutLagOrSpeedIsThereAfterOneStep) {
  VehicleModel model = TailTricopter(ServoMode::kPosition);
  model.hinges[0].time_constant_s = model.hinges[0].speed_max_rad_s = model.hinges[0].torque_max_nm = 0;
  Plant plant(model, {.ground = false});
  std::vector<double> command = model.HoverInput();
  command[3] = 0.1;
  plant.Step(command);
  EXPECT_NEAR(StateOf(plant, model)[6], 0.1, 1e-3);
  plant.Step(command);
  EXPECT_NEAR(StateOf(plant, model)[6], 0.1, 1e-6);
}

// A thrust beside the hinge pulls with a moment of f * arm. A servo with less torque gives in, and one without a limit
// holds.
TEST(PositionServo, HoldsAsStronglyAsItsTorque) {
  VehicleModel model = TailTricopter(ServoMode::kPosition);
  model.rotors[2].p_LR_m = {0, 0.1, 0};
  const auto angle_with = [&](double torque_max_nm) {
    model.hinges[0].torque_max_nm = torque_max_nm;
    Plant plant(model, {.gravity_m_s2 = 0, .ground = false});
    std::vector<double> start(model.signals().states.size());
    plant.Reset(start);
    for (int i = 0; i < 50; ++i) plant.Step({{0, 0, 8, 0}});  // 0.8 N m
    return StateOf(plant, model)[6];
  };
  EXPECT_NEAR(angle_with(0), 0, 1e-4);
  EXPECT_NEAR(angle_with(1), 0, 1e-4);
  EXPECT_GT(angle_with(0.5), 0.5);
}

TEST(PositionServo, StopsShortOfItsStopsAndComesBack) {
  const VehicleModel model = TailTricopter(ServoMode::kPosition);
  Plant plant(model, {.ground = false});
  std::vector<double> command = model.HoverInput();
  for (const double to : {5.0, -5.0}) {
    command[3] = to;
    for (int i = 0; i < 200; ++i) {
      plant.Step(command);
      ASSERT_LT(std::abs(StateOf(plant, model)[6]), 1 + 1e-6);
    }
    EXPECT_NEAR(StateOf(plant, model)[6], std::copysign(1, to), 2e-4);
  }
}

// The motor of a jam must not remain, nor that of the servo in the jam.
TEST(PositionServo, FollowsAgainAfterAJam) {
  const VehicleModel model = TailTricopter(ServoMode::kPosition);
  Plant plant(model, {.ground = false});
  std::vector<double> command = model.HoverInput();
  Disturbance jam;
  jam.hinges[0].held = true;
  command[3] = 0.5;
  for (int i = 0; i < 5; ++i) plant.Step(command);
  const double jammed_rad = StateOf(plant, model)[6];
  for (int i = 0; i < 50; ++i) plant.Step(command, jam);
  EXPECT_NEAR(StateOf(plant, model)[6], jammed_rad, 1e-3);
  for (int i = 0; i < 100; ++i) plant.Step(command);
  EXPECT_NEAR(StateOf(plant, model)[6], 0.5, 1e-3);
}

// The torque that gives the hinges the servos' acceleration: Newton's and Euler's equations are linear in it.
VectorXd AccelerationWithServos(const VehicleModel& model, const VectorXd& q, const VectorXd& q_dot,
                                const VectorXd& u) {
  constexpr double kRise_s = 0.002;
  const auto rotor_count = static_cast<Index>(model.rotors.size()), hinge_count = u.size() - rotor_count;
  VectorXd torques = u;
  torques.tail(hinge_count).setZero();
  const VectorXd without = testing::NewtonEulerAcceleration(model, q, q_dot, torques);
  Eigen::MatrixXd effect(q.size(), hinge_count);
  VectorXd wanted(hinge_count);
  for (Index i = 0; i < hinge_count; ++i) {
    VectorXd with = torques;
    with[rotor_count + i] = 1;
    effect.col(i) = testing::NewtonEulerAcceleration(model, q, q_dot, with) - without;
    const double lag_s = model.hinges[static_cast<std::size_t>(i)].time_constant_s;
    wanted[i] = (u[rotor_count + i] - q[6 + i] - (lag_s + kRise_s) * q_dot[6 + i]) / (lag_s * kRise_s);
  }
  const VectorXd torque =
      effect.bottomRows(hinge_count).fullPivLu().solve(wanted - without.tail(hinge_count));
  return without + effect * torque;
}

TEST(PositionServo, EquationsAreThoseOfTheTorqueThatFollows) {
  for (const VehicleModel& model :
       {TailTricopter(ServoMode::kPosition), TiltQuadrotor(ServoMode::kPosition)}) {
    std::mt19937_64 generator(3);
    const Index n = CoordinateCount(model);
    for (int trial = 0; trial < 50; ++trial) {
      VectorXd q(n), q_dot(n), u(InputCount(model));
      for (Index i = 0; i < n; ++i) {
        q[i] = Draw(generator, 0.8);
        q_dot[i] = Draw(generator, 3);
      }
      for (Index i = 0; i < u.size(); ++i) u[i] = Draw(generator, 0.9);
      const VectorXd ours =
          Acceleration(model, q.cast<Complex>(), q_dot.cast<Complex>(), u.cast<Complex>()).real();
      const VectorXd theirs = AccelerationWithServos(model, q, q_dot, u);
      ASSERT_LT((ours - theirs).norm(), 1e-8 * (1 + theirs.norm())) << model.name;
    }
  }
}

struct Extent {
  double largest_rad = 0, smallest_rad = 0;
  std::vector<double> state;
};
Extent HardOver(const VehicleModel& model, TimeNs step_ns, double torque_nm, TimeNs length_ns) {
  Plant plant(model, {.step_ns = step_ns, .ground = false});
  plant.Reset({0, 0, 50}, {0, 0, 0});
  Extent extent;
  std::vector<double> command = model.HoverInput();
  command[3] = torque_nm;
  for (TimeNs t = 0; t < length_ns; t += step_ns) {
    plant.Step(command);
    extent.state = StateOf(plant, model);
    extent.largest_rad = std::max(extent.largest_rad, extent.state[7]);
    extent.smallest_rad = std::min(extent.smallest_rad, extent.state[7]);
  }
  EXPECT_LT(plant.HingeGap(), 5e-3);
  return extent;
}

// The servo of 0.2 N m turns 5e-7 kg m^2 by 6 rad within one step of 4 ms.
TEST(Stops, HoldALightHingeAtAnyStep) {
  const VehicleModel model = LightBicopter();
  for (const TimeNs step_ns : {200 * kNsPerUs, kNsPerMs, 2 * kNsPerMs, 4 * kNsPerMs}) {
    const Extent up = HardOver(model, step_ns, 0.2, 100 * kNsPerMs);
    EXPECT_NEAR(up.largest_rad, 0.785, 1e-3) << step_ns;
    EXPECT_GT(up.smallest_rad, -0.786) << step_ns;
    const Extent down = HardOver(model, step_ns, -0.2, 100 * kNsPerMs);
    EXPECT_NEAR(down.smallest_rad, -0.785, 1e-3) << step_ns;
    EXPECT_LT(down.largest_rad, 0.786) << step_ns;
  }
}

// The rest of the vehicle moves as with steps of a twentieth.
TEST(Stops, WhatStopsTheHingeTurnsTheBodyAsAtAFineStep) {
  const VehicleModel model = LightBicopter();
  const Extent coarse = HardOver(model, 4 * kNsPerMs, 0.2, 60 * kNsPerMs);
  const Extent fine = HardOver(model, 200 * kNsPerUs, 0.2, 60 * kNsPerMs);
  for (std::size_t i = 0; i < coarse.state.size(); ++i) {
    const double scale = i < 8 ? 0.02 : 0.2;
    EXPECT_NEAR(coarse.state[i], fine.state[i], scale) << model.signals().states[i].name;
  }
}

TEST(Stops, HoldTheShippedVehicle) {
  for (const TimeNs step_ns : {kNsPerMs, 4 * kNsPerMs}) {
    const Extent up = HardOver(Model(), step_ns, 2, 200 * kNsPerMs);
    EXPECT_NEAR(up.largest_rad, 1.5, 1e-4) << step_ns;
    const Extent down = HardOver(Model(), step_ns, -2, 200 * kNsPerMs);
    EXPECT_NEAR(down.smallest_rad, -1.5, 1e-4) << step_ns;
  }
}

// From one stop to the other and back, with both hinges, and with a jam in between.
TEST(Stops, HoldWhateverIsCommanded) {
  const VehicleModel model = LightBicopter();
  std::mt19937_64 generator(5);
  Plant plant(model, {.ground = false});
  plant.Reset({0, 0, 500}, {0, 0, 0});
  for (int i = 0; i < 3000; ++i) {
    Disturbance disturbance;
    disturbance.hinges[0].held = i % 100 > 80;
    disturbance.hinges[0].rate_rad_s = 5;
    plant.Step({{2, 2, Draw(generator, 0.3), Draw(generator, 0.3)}}, disturbance);
    const std::vector<double> state = StateOf(plant, model);
    ASSERT_LT(std::max(std::abs(state[6]), std::abs(state[7])), 0.785 + 2e-3) << i;
    if (plant.Event() == FlightEvent::kNotFinite) FAIL() << plant.EventText();
  }
}

// A stop acts between two bodies: without gravity nothing changes the whole vehicle's momentum.
TEST(Stops, KeepTheMomentum) {
  const VehicleModel model = LightBicopter();
  Plant plant(model, {.gravity_m_s2 = 0, .ground = false});
  plant.Reset({0, 0, 0}, {0, 0, 0});
  const auto before = plant.Momentum();
  for (int i = 0; i < 100; ++i) plant.Step({{0, 0, i % 20 < 10 ? 0.05 : -0.05, 0.02}});
  for (std::size_t i = 0; i < 6; ++i) EXPECT_NEAR(plant.Momentum()[i], before[i], 2e-3) << i;
}

TEST(Stops, SameCallsSameBits) {
  const VehicleModel model = LightBicopter();
  const auto fly = [&](Plant& plant) {
    plant.Reset({0, 0, 50}, {0, 0, 0});
    for (int i = 0; i < 300; ++i) plant.Step({{3, 3, i % 30 < 15 ? 0.2 : -0.2, i % 7 < 3 ? 0.2 : -0.2}});
    return StateOf(plant, model);
  };
  Plant first(model, {}), second(model, {});
  const std::vector<double> once = fly(first);
  EXPECT_EQ(fly(first), once);
  EXPECT_EQ(fly(second), once);
}

}  // namespace
}  // namespace tiltproof::plant
