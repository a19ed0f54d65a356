// Vehicles with any list of rotors and hinges: signals, hover, motion, and a controller designed on one.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <numbers>
#include <random>

#include "plant/dynamics.h"
#include "plant/lqr_design.h"
#include "plant/plant.h"
#include "tests/plant/models.h"
#include "tests/plant/rotor_vehicles.h"
#include "tests/support/newton_euler_model.h"

namespace tiltproof::plant {
namespace {

using Eigen::Index;
using Eigen::Vector3d;
using Eigen::VectorXd;

TEST(RotorList, NamesTheSignals) {
  const VehicleSignals quadrotor = Quadrotor().signals();
  EXPECT_EQ(quadrotor.states.size(), 12U);
  EXPECT_EQ(quadrotor.inputs.size(), 4U);
  EXPECT_EQ(quadrotor.inputs[2].name, "f_rear_left_n");
  EXPECT_EQ(quadrotor.rotors.size(), 4U);
  EXPECT_TRUE(quadrotor.joints.empty());
  const VehicleSignals tricopter = Tricopter().signals();
  EXPECT_EQ(tricopter.states[6].name, "alpha_tail_rad");
  EXPECT_EQ(tricopter.inputs[1].name, "f_tail_n");
  // Only right and left are spelled by a letter.
  EXPECT_EQ(tricopter.inputs[2].name, "f_l_n");
  EXPECT_EQ(tricopter.inputs[4].name, "tau_tail_nm");
  EXPECT_EQ(tricopter.inputs[4].max, 2);
  EXPECT_EQ(tricopter.joints, std::vector<std::string>{"tail_joint"});
}

// Moments about the rotors' centre: f_i = m g / 4 (1 + c_x / x_i + c_y / y_i) balances force, roll, pitch and yaw.
TEST(RotorList, QuadrotorHovers) {
  const VehicleModel model = Quadrotor();
  EXPECT_NEAR(model.hover.roll_rad, 0, 1e-12);
  EXPECT_NEAR(model.hover.pitch_rad, 0, 1e-12);
  EXPECT_TRUE(model.hover.hinge_rad.empty());
  for (std::size_t i = 0; i < 4; ++i) {
    const Vector3d& p_m = model.rotors[i].p_LR_m;
    EXPECT_NEAR(model.hover.input[i], 1.2 * kG_m_s2 / 4 * (1 + 0.012 / p_m.x() - 0.007 / p_m.y()), 1e-11);
  }
}

// Many thrusts balance six rotors. The least ones are m g (1/6 + (x_i c_x + y_i c_y) / (3 r^2)), because the sums of
// x y, x, y, and of each with the directions are zero.
TEST(RotorList, HexarotorHoversWithTheLeastThrusts) {
  const VehicleModel model = Hexarotor();
  EXPECT_NEAR(model.hover.roll_rad, 0, 1e-11);
  EXPECT_NEAR(model.hover.pitch_rad, 0, 1e-11);
  for (std::size_t i = 0; i < 6; ++i) {
    const Vector3d& p_m = model.rotors[i].p_LR_m;
    const double share =
        1.0 / 6 + (p_m.x() * 0.015 + p_m.y() * 0.02) / (3 * kHexarotorRadius_m * kHexarotorRadius_m);
    EXPECT_NEAR(model.hover.input[i], 2.5 * kG_m_s2 * share, 1e-9);
  }
}

// A rotor with twice the limit takes more of the load: of two pairs on one line, four times as much.
TEST(RotorList, HoverLoadsRotorsByTheirLimits) {
  VehicleModel model = Quadrotor({0, 0, 0});
  for (std::size_t i = 0; i < 4; ++i) model.rotors.push_back(model.rotors[i]);
  for (std::size_t i = 4; i < 8; ++i) model.rotors[i].force_max_n = 20;
  const Hover hover = SolveHover(model);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR(hover.input[i], 1.2 * kG_m_s2 / 4 / 5, 1e-9);
    EXPECT_NEAR(hover.input[4 + i], 1.2 * kG_m_s2 / 4 * 4 / 5, 1e-9);
  }
}

// The hinged bodies are balanced, so no servo holds anything, thrust is vertical, and the body hangs with the common
// centre of mass under the hinges.
TEST(RotorList, BicopterAndBoomHangUnderTheirHinges) {
  for (const VehicleModel& model : {Bicopter(), Boom()}) {
    const double pitch = std::atan(kComX_m / (kHingeHeight_m - kComZ_m));
    EXPECT_NEAR(model.hover.roll_rad, 0, 1e-10) << model.name;
    EXPECT_NEAR(model.hover.pitch_rad, pitch, 1e-10) << model.name;
    for (const double angle : model.hover.hinge_rad) EXPECT_NEAR(angle, -pitch, 1e-10) << model.name;
    EXPECT_NEAR(model.hover.input[0], model.MassTotal() * kG_m_s2 / 2, 1e-9) << model.name;
    EXPECT_NEAR(model.hover.input[1], model.MassTotal() * kG_m_s2 / 2, 1e-9) << model.name;
    for (std::size_t i = 2; i < model.hover.input.size(); ++i)
      EXPECT_NEAR(model.hover.input[i], 0, 1e-10) << model.name;
  }
}

// The tail's tilt a balances the drag: c f sin a = -k f cos a, so tan a = -k / c. The front balances the moment of the
// tail, and a roll its side force.
TEST(RotorList, TailTricopterHoversWithItsTailTilted) {
  for (const ServoMode servo : {ServoMode::kTorque, ServoMode::kPosition}) {
    const VehicleModel model = TailTricopter(servo);
    constexpr double k = 0.016, kWeight_n = (1.4 + 0.1) * kG_m_s2;
    const double a = std::atan(-k / kTailArm_m);
    const double front_per_tail = (kTailArm_m * std::cos(a) - k * std::sin(a)) / kFrontArm_m;
    const double tail_n = kWeight_n / std::hypot(front_per_tail + std::cos(a), std::sin(a));
    EXPECT_NEAR(model.hover.hinge_rad[0], a, 1e-10);
    EXPECT_NEAR(model.hover.roll_rad, std::asin(-tail_n * std::sin(a) / kWeight_n), 1e-10);
    EXPECT_NEAR(model.hover.pitch_rad, 0, 1e-10);
    EXPECT_NEAR(model.hover.input[0], front_per_tail * tail_n / 2, 1e-9);
    EXPECT_NEAR(model.hover.input[1], front_per_tail * tail_n / 2, 1e-9);
    EXPECT_NEAR(model.hover.input[2], tail_n, 1e-9);
    EXPECT_NEAR(model.hover.input[3], servo == ServoMode::kTorque ? 0 : a, 1e-10);
  }
}

// Level, the front takes m g (1/2 + c / (4 x)) because the moments about the middle balance, each side half of it. The
// hinges do nothing: an angle would only add to the sum of squares.
TEST(RotorList, TiltQuadrotorHoversLevel) {
  for (const ServoMode servo : {ServoMode::kTorque, ServoMode::kPosition}) {
    for (const double com_x_m : {0.0, 0.02}) {
      const VehicleModel model = TiltQuadrotor(servo, com_x_m);
      EXPECT_NEAR(model.hover.roll_rad, 0, 1e-10);
      if (com_x_m == 0) {
        EXPECT_NEAR(model.hover.pitch_rad, 0, 1e-10);
      }
      double force_x_n = 0, force_z_n = 0, moment_nm = 0;
      for (std::size_t i = 0; i < 4; ++i) {
        // Along the body's axes.
        const double angle = model.hover.hinge_rad[i], f_n = model.hover.input[i];
        const double x_n = f_n * std::sin(angle), z_n = f_n * std::cos(angle);
        force_x_n += x_n;
        force_z_n += z_n;
        moment_nm += 0.02 * x_n - (i < 2 ? 0.2 : -0.2) * z_n;
        if (com_x_m == 0) {
          EXPECT_NEAR(angle, 0, 1e-10);
          EXPECT_NEAR(f_n, 2.0 * kG_m_s2 / 4, 1e-9);
        }
        EXPECT_NEAR(model.hover.input[4 + i], servo == ServoMode::kTorque ? 0 : angle, 1e-9);
      }
      const double pitch = model.hover.pitch_rad, weight_n = 2.0 * kG_m_s2;
      EXPECT_NEAR(force_x_n, -weight_n * std::sin(pitch), 1e-7);
      EXPECT_NEAR(force_z_n, weight_n * std::cos(pitch), 1e-7);
      // The weight of the base at (com_x, -0.03), and of the four hinged bodies at (0, 0.02).
      const double arm_x = 1.6 / 2 * com_x_m, arm_z = 1.6 / 2 * -0.03 + 0.4 / 2 * 0.02;
      EXPECT_NEAR(moment_nm + weight_n * (arm_z * std::sin(pitch) + arm_x * std::cos(pitch)), 0, 1e-7);
    }
  }
}

// The world stands still where the statics say.
TEST(RotorList, TheWorldHovers) {
  for (const VehicleModel& model :
       {Bicopter(), TailTricopter(ServoMode::kTorque), TailTricopter(ServoMode::kPosition), Quadrotor(),
        Hexarotor(), TiltQuadrotor(ServoMode::kTorque, 0.02), TiltQuadrotor(ServoMode::kPosition, 0.02)}) {
    Plant plant(model, {});
    plant.Reset({0, 0, 5}, {model.hover.roll_rad, model.hover.pitch_rad, 0});
    for (int i = 0; i < 250; ++i) plant.Step(model.HoverInput());
    std::vector<double> state(model.signals().states.size());
    plant.State(state);
    EXPECT_LT(std::hypot(state[0], state[1], state[2] - 5), 1e-5) << model.name;
  }
}

TEST(RotorList, NoHoverIsAnError) {
  // Nothing balances the drag of a single propeller.
  VehicleModel model = Body("single", 0.5, {0, 0, 0});
  model.rotors = {RotorAt("only", {0, 0, 0.1}, 1)};
  EXPECT_THROW(SolveHover(model), DesignError);
  model.rotors[0].drag_ratio_m = 0;
  EXPECT_NEAR(SolveHover(model).input[0], 0.5 * kG_m_s2, 1e-9);
  // Nor does anything balance rotors that are all on one side.
  model = Quadrotor();
  for (Rotor& rotor : model.rotors) rotor.p_LR_m.y() += 1;
  model.rotors[3].thrust_axis_L = -Vector3d::UnitZ();
  for (Rotor& rotor : model.rotors) rotor.p_LR_m.x() = 0.1;
  EXPECT_THROW(SolveHover(model), DesignError);
}

struct Moment {
  VectorXd q, q_dot, u;
};
Moment RandomMoment(const VehicleModel& model, std::mt19937_64& generator) {
  Moment at{VectorXd(CoordinateCount(model)), VectorXd(CoordinateCount(model)), VectorXd(InputCount(model))};
  for (Index i = 0; i < at.q.size(); ++i) {
    at.q[i] = Draw(generator, i == 2 ? 1 : i == 4 ? 1.2 : i >= 6 ? 0.9 : 3);
    at.q_dot[i] = Draw(generator, 4);
  }
  at.q[2] += 5;
  for (Index i = 0; i < at.u.size(); ++i)
    at.u[i] = i < static_cast<Index>(model.rotors.size()) ? 5 + Draw(generator, 5) : Draw(generator, 1);
  return at;
}
VectorXd OurAcceleration(const VehicleModel& model, const Moment& at) {
  return Acceleration(model, at.q.cast<Complex>(), at.q_dot.cast<Complex>(), at.u.cast<Complex>()).real();
}

class EveryVehicle : public ::testing::TestWithParam<VehicleModel (*)()> {};
INSTANTIATE_TEST_SUITE_P(RotorList, EveryVehicle,
                         ::testing::Values(
                             +[] { return Quadrotor(); }, &Hexarotor, &Bicopter, &Boom, &Tricopter));

TEST_P(EveryVehicle, AcceleratesAsNewtonAndEulerSay) {
  const VehicleModel model = GetParam()();
  std::mt19937_64 generator(7);
  for (int i = 0; i < 200; ++i) {
    const Moment at = RandomMoment(model, generator);
    const VectorXd theirs = testing::NewtonEulerAcceleration(model, at.q, at.q_dot, at.u);
    EXPECT_LT((OurAcceleration(model, at) - theirs).norm(), 1e-9 * (1 + theirs.norm())) << model.name;
  }
}

TEST_P(EveryVehicle, HoverStandsStill) {
  const VehicleModel model = GetParam()();
  const VectorXd q = HoverCoordinates(model.hover), u = HoverInputs(model.hover);
  EXPECT_LT(testing::NewtonEulerAcceleration(model, q, VectorXd::Zero(q.size()), u).norm(), 1e-8);
}

TEST_P(EveryVehicle, LinearModelIsTheDerivative) {
  const VehicleModel model = GetParam()();
  const LinearModel linear = Linearise(model, model.hover);
  const Index n = CoordinateCount(model);
  ASSERT_EQ(linear.a.rows(), 2 * n);
  ASSERT_EQ(linear.b.cols(), InputCount(model));
  VectorXd at(2 * n + InputCount(model));
  at << HoverCoordinates(model.hover), VectorXd::Zero(n), HoverInputs(model.hover);
  const auto acceleration = [&](const VectorXd& x) {
    return testing::NewtonEulerAcceleration(model, x.head(n), x.segment(n, n), x.tail(InputCount(model)));
  };
  constexpr double h = 1e-5;
  for (Index i = 0; i < at.size(); ++i) {
    const VectorXd d = h * VectorXd::Unit(at.size(), i);
    const VectorXd difference = (acceleration(at + d) - acceleration(at - d)) / (2 * h);
    const VectorXd exact = i < 2 * n ? linear.a.col(i).tail(n) : linear.b.col(i - 2 * n).tail(n);
    EXPECT_LT((exact - difference).norm(), 1e-6 * (1 + difference.norm())) << model.name << ' ' << i;
  }
  EXPECT_TRUE(linear.a.topRightCorner(n, n).isIdentity(0));
}

// A short step of ODE changes the rates by the acceleration. The first step does not yet feel that a tilting body moves
// on a circle, because ODE holds rates to the hinges as they are before the step: the second one does.
TEST_P(EveryVehicle, TheWorldStepsAsTheEquationsSay) {
  const VehicleModel model = GetParam()();
  constexpr TimeNs kStep_ns = 10'000;
  Plant plant(model, {.step_ns = kStep_ns});
  const Index n = CoordinateCount(model);
  std::mt19937_64 generator(11);
  for (int trial = 0; trial < 20; ++trial) {
    Moment at = RandomMoment(model, generator);
    // A level body without angular rates: there Euler rates are the world's, and so are their derivatives.
    at.q.segment<3>(3).setZero();
    at.q_dot.segment<3>(3).setZero();
    std::vector<double> state(static_cast<std::size_t>(2 * n)), after(state.size());
    for (Index i = 0; i < n; ++i) {
      state[static_cast<std::size_t>(i)] = at.q[i];
      state[static_cast<std::size_t>(n + i)] = at.q_dot[i];
    }
    plant.Reset(state);
    const std::vector<double> input(at.u.data(), at.u.data() + at.u.size());
    plant.Step(input);
    plant.State(state);
    plant.Step(input);
    plant.State(after);
    const VectorXd expected = OurAcceleration(model, at);
    for (Index i = 0; i < n; ++i) {
      const auto place = static_cast<std::size_t>(n + i);
      EXPECT_NEAR((after[place] - state[place]) / ToSeconds(kStep_ns), expected[i],
                  2e-3 * (1 + expected.cwiseAbs().maxCoeff()))
          << model.name << ' ' << i;
    }
  }
}

// Without ground, gravity and inputs nothing may gain or lose momentum.
TEST_P(EveryVehicle, KeepsItsMomentum) {
  const VehicleModel model = GetParam()();
  Plant plant(model, {.step_ns = kNsPerMs, .gravity_m_s2 = 0, .ground = false});
  std::vector<double> state(model.signals().states.size());
  for (std::size_t i = 0; i < state.size(); ++i) state[i] = 0.1 * static_cast<double>(i % 3) + 0.05;
  plant.Reset(state);
  const auto before = plant.Momentum();
  for (int i = 0; i < 200; ++i) plant.Step(std::vector<double>(model.signals().inputs.size()));
  for (std::size_t i = 0; i < 6; ++i) EXPECT_NEAR(plant.Momentum()[i], before[i], 1e-3) << model.name;
  EXPECT_LT(plant.HingeGap(), 1e-4);
}

// A thrust beside the centre of mass turns the body, and a shift of the centre of mass changes how.
TEST(RotorList, ThrustTurnsTheBodyAboutItsShiftedCentreOfMass) {
  const VehicleModel model = Quadrotor({0, 0, 0});
  Plant plant(model, {});
  std::vector<double> state(12);
  Disturbance shifted;
  shifted.com_shift_m = {0, 0.02, 0};
  plant.Reset({0, 0, 5}, {0, 0, 0});
  for (int i = 0; i < 10; ++i) plant.Step(model.HoverInput());
  plant.State(state);
  EXPECT_NEAR(state[9], 0, 1e-12);
  for (int i = 0; i < 10; ++i) plant.Step(model.HoverInput(), shifted);
  plant.State(state);
  // 40 ms of the torque m g 0.02 m about -x.
  const Eigen::Matrix3d& inertia = model.base.inertia_kg_m2;
  const Vector3d rate = inertia.inverse() * Vector3d(-1.2 * kG_m_s2 * 0.02, 0, 0) * 0.04;
  EXPECT_NEAR(state[9], rate.x(), 0.02 * std::abs(rate.x()));
}

TEST(RotorList, MoreRotorsThanADisturbanceHasAreRefused) {
  VehicleModel model = Quadrotor();
  while (model.rotors.size() <= kRotorsMax) model.rotors.push_back(model.rotors[0]);
  EXPECT_THROW(Plant(model, {}), PlantError);
}

// The designed law flies the vehicle in the plant: from beside its hover back to it.
void ExpectStabilised(const VehicleModel& model) {
  const LqrDesign design = DesignLqr(model);
  const auto n = static_cast<std::size_t>(CoordinateCount(model));
  ASSERT_EQ(design.gain.rows(), InputCount(model));
  ASSERT_EQ(design.gain.cols(), static_cast<Index>(2 * n + kIntegralCount));
  EXPECT_LT(design.spectral_radius, 1);
  EXPECT_LT(design.dare_residual, 1e-10);
  EXPECT_GT(design.delay_margin_s, 4e-3);
  Plant plant(model, {});
  plant.Reset({0.4, -0.3, 2.3}, {0.1, -0.05, 0.2});
  const VectorXd target = HoverCoordinates(design.hover) + 2.0 * VectorXd::Unit(static_cast<Index>(n), 2);
  VectorXd x = VectorXd::Zero(static_cast<Index>(2 * n) + kIntegralCount);
  Eigen::Vector4d error_before = Eigen::Vector4d::Zero();
  std::vector<double> state(2 * n);
  for (int period = 0; period < 2500; ++period) {
    plant.State(state, RatesFrame::kEuler);
    x.head(static_cast<Index>(2 * n)) = Eigen::Map<const VectorXd>(state.data(), static_cast<Index>(2 * n));
    x.head(static_cast<Index>(n)) -= target;
    const Eigen::Vector4d error(x[0], x[1], x[2], x[5]);
    if (period > 0) x.tail<4>() += 0.006 * (error_before + error);
    error_before = error;
    const VectorXd u = VectorXd(HoverInputs(design.hover)) - design.gain * x;
    for (int i = 0; i < 3; ++i) plant.Step(std::vector<double>(u.data(), u.data() + u.size()));
    ASSERT_EQ(plant.Event(), FlightEvent::kNone) << period << ' ' << plant.EventText();
  }
  EXPECT_LT(error_before.norm(), 1e-3);
}

TEST(RotorList, DesignedLawFliesAQuadrotor) { ExpectStabilised(Quadrotor()); }
TEST(RotorList, DesignedLawFliesAHexarotor) { ExpectStabilised(Hexarotor()); }
TEST(RotorList, DesignedLawFliesABicopter) { ExpectStabilised(Bicopter()); }
TEST(RotorList, DesignedLawFliesATricopterWithATorqueServo) {
  ExpectStabilised(TailTricopter(ServoMode::kTorque));
}
TEST(RotorList, DesignedLawFliesATricopterWithAPositionServo) {
  ExpectStabilised(TailTricopter(ServoMode::kPosition));
}
TEST(RotorList, DesignedLawFliesATiltQuadrotorWithPositionServos) {
  ExpectStabilised(TiltQuadrotor(ServoMode::kPosition));
}

}  // namespace
}  // namespace tiltproof::plant
