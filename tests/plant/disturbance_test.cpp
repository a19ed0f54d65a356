// Effects of a disturbance on the plant, each compared with mechanics that is written down apart from it: the
// momentum of a free body, closed forms of a fall, and Lagrange's equations with other masses.
#include "link/disturbance.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "plant/plant.h"
#include "tests/plant/models.h"
#include "tests/support/lagrange_model.h"
#include "tests/support/tiltrotor_plant.h"

namespace tiltproof::plant {
namespace {

using ::testing::HasSubstr;
using testing::LagrangeModel;
using testing::LagrangeParameters;
using testing::TiltrotorPlant;

const PlantOptions kSpace{.step_ns = kNsPerMs, .gravity_m_s2 = 0, .ground = false};

// The same without input, thrust and servo torque 0.
struct Free : TiltrotorPlant {
  explicit Free(const PlantOptions& options = kSpace, const VehicleModel& model = Model())
      : TiltrotorPlant(model, options) {
    Reset({0, 0, 100}, {0, 0, 0});
  }
  void Fly(int steps, const Disturbance& disturbance) {
    for (int i = 0; i < steps; ++i) Plant::Step(std::vector<double>(4, 0.0), disturbance);
  }
};

TEST(Disturbance, SaysNothingByDefault) {
  EXPECT_EQ(Combined({}, {}), Disturbance{});
  Disturbance wind;
  wind.wind_m_s = {3, 0, 0};
  EXPECT_EQ(Combined({}, wind), wind);
  EXPECT_EQ(Combined(wind, {}), wind);
}

TEST(Disturbance, TwoCombine) {
  Disturbance a, b;
  a.force_n = {1, 2, 3};
  b.force_n = {10, 0, 0};
  a.mass_factor = 2;
  b.mass_factor = 1.5;
  a.thrust_factor[1] = 0.5;
  b.thrust_factor[1] = 0.5;
  a.hinges[0] = {true, 1.0};
  b.hinges[0] = {true, 0.0};
  const Disturbance both = Combined(a, b);
  EXPECT_EQ(both.force_n, (Disturbance::Vector{11, 2, 3}));
  EXPECT_EQ(both.mass_factor, 3);
  EXPECT_EQ(both.thrust_factor[1], 0.25);
  EXPECT_EQ(both.hinges[0].rate_rad_s, 0);
}

// The change of a free body's momentum is the force times its time.
TEST(Disturbance, AForceGivesItsMomentum) {
  Free plant;
  Disturbance push;
  push.force_n = {1.5, -2, 0.5};
  plant.Fly(400, push);
  const auto momentum = plant.Momentum();
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(momentum[i], push.force_n[i] * 0.4, 1e-9) << i;
  plant.Fly(100, {});
  EXPECT_NEAR(plant.Momentum()[0], 0.6, 1e-9);
}

TEST(Disturbance, ATorqueGivesItsAngularMomentum) {
  Free plant;
  Disturbance twist;
  twist.torque_nm = {0.02, -0.01, 0.03};
  plant.Fly(200, twist);
  const auto momentum = plant.Momentum();
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(momentum[i], 0, 1e-9) << i;
    EXPECT_NEAR(momentum[3 + i], twist.torque_nm[i] * 0.2, 2e-5) << i;
  }
}

VehicleModel WithDrag(const BodyDrag& drag) {
  VehicleModel model = Model();
  model.drag = drag;
  return model;
}

const PlantOptions kAir{.step_ns = 100 * kNsPerUs, .ground = false};

// m v' = -m g - c v falls at -(m g / c) (1 - exp(-c t / m)); m v' = -m g + q v^2 at -v_t tanh(g t / v_t).
TEST(Drag, SlowsAFallAsItsClosedFormsSay) {
  const double mass_kg = Model().MassTotal(), time_s = 1.0;
  Free linear(kAir, WithDrag({.linear_n_s_m = 3.0}));
  linear.Fly(10'000, {});
  const double terminal = mass_kg * 9.81 / 3.0;
  EXPECT_NEAR(linear.Momentum()[2] / mass_kg, -terminal * (1 - std::exp(-3.0 * time_s / mass_kg)), 2e-3);

  Free quadratic(kAir, WithDrag({.quadratic_n_s2_m2 = 0.5}));
  quadratic.Fly(10'000, {});
  const double fall_m_s = std::sqrt(mass_kg * 9.81 / 0.5);
  EXPECT_NEAR(quadratic.Momentum()[2] / mass_kg, -fall_m_s * std::tanh(9.81 * time_s / fall_m_s), 2e-3);

  Free none(kAir);
  none.Fly(10'000, {});
  EXPECT_NEAR(none.State().vz_m_s, -9.81 * time_s, 1e-6);
}

TEST(Drag, WindCarriesAlongWhatHasDrag) {
  Disturbance wind;
  wind.wind_m_s = {0, 4, 3};
  Free plant(kSpace, WithDrag({.linear_n_s_m = 1, .quadratic_n_s2_m2 = 0.2}));
  plant.Fly(1, wind);
  const double force_n = (1 + 0.2 * 5) * 5;  // along the wind of 5 m/s
  EXPECT_NEAR(plant.Momentum()[1], force_n * 0.8 * 1e-3, 1e-12);
  EXPECT_NEAR(plant.Momentum()[2], force_n * 0.6 * 1e-3, 1e-12);

  Free without;
  without.Fly(100, wind);
  EXPECT_EQ(without.Momentum()[1], 0);
}

// Compares the accelerations in one short step from rest with Lagrange's equations.
class OtherBodies : public ::testing::Test {
 protected:
  void Compare(const Disturbance& disturbance, const LagrangeParameters& parameters) {
    constexpr double kStep_s = 1e-6;
    LagrangeModel::State state;
    state.q << 1, 2, 30, 0.2, -0.3, 0.5, 0.1, -0.2;
    const ActuatorsTruth input{.f_r_n = 12, .f_l_n = 9, .tau_r_nm = 0.001, .tau_l_nm = -0.002};
    TiltrotorPlant plant(Model(), {.step_ns = 1000, .ground = false});
    plant.Reset(testing::ToSensors(state));
    plant.Plant::Step(testing::Row(input), disturbance);
    const SensorsTruth after = plant.State(RatesFrame::kEuler);
    const LagrangeModel::Vector8 expected =
        LagrangeModel(parameters).Acceleration(state.q, state.q_dot, input);
    const double found[] = {after.vx_m_s,   after.vy_m_s,   after.vz_m_s,        after.wx_rad_s,
                            after.wy_rad_s, after.wz_rad_s, after.alpha_r_rad_s, after.alpha_l_rad_s};
    for (int i = 0; i < 8; ++i)
      EXPECT_NEAR(found[i] / kStep_s, expected[i], 1e-3 * (1 + std::abs(expected[i]))) << i;
    EXPECT_LT(plant.HingeGap(), 1e-9);
    // The position and the hinge angle have not changed.
    EXPECT_NEAR(after.x_m, 1, 1e-9);
    EXPECT_NEAR(after.alpha_r_rad, 0.1, 1e-9);
  }
};

TEST_F(OtherBodies, NominalAreLagranges) { Compare({}, testing::DesignPlant()); }

TEST_F(OtherBodies, WithAnotherMass) {
  Disturbance heavy;
  heavy.mass_factor = 1.7;
  LagrangeParameters parameters = testing::DesignPlant();
  parameters.base.mass_kg *= 1.7;
  for (auto& thruster : parameters.thrusters) thruster.mass_kg *= 1.7;
  Compare(heavy, parameters);
}

TEST_F(OtherBodies, WithAnotherInertia) {
  Disturbance broad;
  broad.inertia_factor = 0.6;
  LagrangeParameters parameters = testing::DesignPlant();
  parameters.base.inertia_kg_m2 *= 0.6;
  for (auto& thruster : parameters.thrusters) thruster.inertia_kg_m2 *= 0.6;
  Compare(broad, parameters);
}

TEST_F(OtherBodies, WithAShiftedCentreOfMass) {
  Disturbance shifted;
  shifted.com_shift_m = {0.04, -0.03, 0.02};
  LagrangeParameters parameters = testing::DesignPlant();
  parameters.base.com_m += Eigen::Vector3d(0.04, -0.03, 0.02);
  Compare(shifted, parameters);
}

TEST(Disturbance, WhatItChangedOfTheBodiesEndsWithIt) {
  Disturbance heavy;
  heavy.mass_factor = 2;
  heavy.com_shift_m = {0.05, 0, 0};
  Free plant;
  const double energy_j = plant.Energy();
  plant.Fly(10, heavy);
  plant.Fly(10, {});
  EXPECT_NEAR(plant.Energy(), energy_j, 1e-12);
  EXPECT_NEAR(plant.State().z_m, 100, 1e-9);

  plant.Fly(10, heavy);
  plant.Reset({0, 0, 5}, {0, 0, 0});
  Free fresh;
  fresh.Reset({0, 0, 5}, {0, 0, 0});
  Disturbance push;
  push.force_n = {1, 2, 3};
  plant.Fly(100, push);
  fresh.Fly(100, push);
  EXPECT_EQ(plant.State(), fresh.State());  // to the bit
}

TEST(Disturbance, AFactorOfThrustIsThatMuchLessThrust) {
  TiltrotorPlant weak(Model(), {}), commanded(Model(), {});
  Disturbance weak_left;
  weak_left.thrust_factor[1] = 0.5;
  ActuatorsTruth input{.f_r_n = 10, .f_l_n = 12, .tau_r_nm = 0.01, .tau_l_nm = 0};
  weak.Plant::Step(testing::Row(input), weak_left);
  input.f_l_n = 6;
  commanded.Step(input);
  EXPECT_EQ(weak.State(), commanded.State());
}

TEST(Disturbance, AJammedHingeStaysWhereItIs) {
  TiltrotorPlant plant(Model(), kSpace);
  plant.Reset({.z_m = 10, .alpha_r_rad = 0.3, .alpha_l_rad = 0.1});
  Disturbance jam;
  jam.hinges[0].held = true;
  const std::vector<double> input = {0, 0, 1.5, 0};  // the servo pulls
  for (int i = 0; i < 500; ++i) plant.Plant::Step(input, jam);
  EXPECT_NEAR(plant.State().alpha_r_rad, 0.3, 1e-6);
  EXPECT_NEAR(plant.State().alpha_r_rad_s, 0, 1e-6);
  // The force that holds the hinge is inside the vehicle.
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(plant.Momentum()[i], 0, 1e-9);
  for (int i = 0; i < 5; ++i) plant.Plant::Step(input, {});
  EXPECT_GT(plant.State().alpha_r_rad, 0.31);
}

TEST(Disturbance, ARunawayHingeTurnsAtItsRateToItsStop) {
  for (const double rate_rad_s : {0.8, -0.8}) {
    TiltrotorPlant plant(Model(), kSpace);
    plant.Reset({.z_m = 10});
    Disturbance runaway;
    runaway.hinges[1] = {true, rate_rad_s};
    const std::vector<double> input = {0, 0, 0, -1.5 * rate_rad_s};
    for (int i = 0; i < 1000; ++i) plant.Plant::Step(input, runaway);
    EXPECT_NEAR(plant.State().alpha_l_rad, rate_rad_s, 1e-6);
    for (int i = 0; i < 2000; ++i) plant.Plant::Step(input, runaway);
    EXPECT_NEAR(plant.State().alpha_l_rad, std::copysign(1.5, rate_rad_s), 1e-3);
    EXPECT_EQ(plant.Event(), FlightEvent::kNone);
  }
}

TEST(Disturbance, OneThatIsNoNumberEndsTheFlight) {
  Disturbance nan, massless;
  nan.torque_nm[1] = std::numeric_limits<double>::quiet_NaN();
  massless.mass_factor = 0;
  for (const Disturbance& bad : {nan, massless}) {
    Free plant;
    plant.Fly(1, bad);
    EXPECT_EQ(plant.Event(), FlightEvent::kNotFinite);
    EXPECT_THAT(plant.EventText(), HasSubstr("disturbance"));
  }
}

TEST(Drag, TheVariantForWindIsTheTiltrotorButForItsDrag) {
  const VehicleModel with = LoadShipped("tiltrotor_drag");
  EXPECT_GT(with.drag.quadratic_n_s2_m2, 0);
  EXPECT_EQ(Model().drag, BodyDrag{});
  VehicleSignals signals = with.signals();
  EXPECT_TRUE(signals.feels_wind);
  signals.feels_wind = false;
  EXPECT_EQ(signals, Model().signals());
  EXPECT_EQ(with.hover.input, Model().hover.input);
  TiltrotorPlant one(with, kSpace), other(Model(), kSpace);
  // At rest the air does nothing: the same bits.
  one.Reset({0, 0, 5}, {0, 0, 0});
  other.Reset({0, 0, 5}, {0, 0, 0});
  const ActuatorsTruth input{.f_r_n = 10, .f_l_n = 11, .tau_r_nm = 0.1, .tau_l_nm = 0.2};
  one.Step(input);
  other.Step(input);
  EXPECT_EQ(one.State(), other.State());
}

}  // namespace
}  // namespace tiltproof::plant
