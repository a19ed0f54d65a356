// The shipped vehicles against their sources and against statics by hand.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>
#include <vector>

#include "plant/dynamics.h"
#include "plant/plant.h"
#include "tests/plant/models.h"

namespace tiltproof::plant {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;

// The largest generalised force of the vehicle, level and at rest, with these thrusts: 0 in hover.
double Unbalance(const VehicleModel& model, const std::vector<double>& thrusts_n) {
  const Coordinates<Complex> zero = Coordinates<Complex>::Zero(CoordinateCount(model));
  Inputs<Complex> u = Inputs<Complex>::Zero(InputCount(model));
  for (std::size_t i = 0; i < thrusts_n.size(); ++i) u[static_cast<Eigen::Index>(i)] = thrusts_n[i];
  return ComputeEquationsOfMotion(model, zero, zero, u).force.real().cwiseAbs().maxCoeff();
}

TEST(ShippedVehicles, TheQuadrotorHasThePublishedNumbers) {
  const VehicleModel model = LoadShipped("quadrotor");
  constexpr double kRotor_kg = 0.009, kBody_kg = 0.68, kMass_kg = kBody_kg + 4 * kRotor_kg;
  EXPECT_DOUBLE_EQ(model.MassTotal(), kMass_kg);
  ASSERT_EQ(model.rotors.size(), 4U);
  EXPECT_TRUE(model.hinges.empty());
  for (const Rotor& rotor : model.rotors) {
    EXPECT_NEAR(std::hypot(rotor.p_LR_m.x(), rotor.p_LR_m.y()), 0.17, 1e-7) << rotor.name;
    EXPECT_NEAR(rotor.force_max_n, 8.54858e-6 * 838 * 838, 1e-4);
    EXPECT_EQ(rotor.time_constant_up_s, 0.0125);
    EXPECT_EQ(rotor.time_constant_down_s, 0.025);
  }
  // Four point masses on the arms, at a height of 0.01 m, and the body's moment about the new centre of mass.
  const double height_m = 4 * kRotor_kg * 0.01 / kMass_kg;
  EXPECT_NEAR(model.base.p_com_m.z(), height_m, 1e-15);
  const double own_kg_m2 = kRotor_kg / 12 * (0.1 * 0.1 + 0.015 * 0.015);
  EXPECT_NEAR(model.base.inertia_kg_m2(2, 2), 0.012 + 4 * (kRotor_kg * 0.17 * 0.17 + own_kg_m2), 1e-9);
  const double lateral_kg_m2 = 4 * (kRotor_kg / 12 * (0.015 * 0.015 + 0.003 * 0.003)) +
                               2 * kRotor_kg * 0.17 * 0.17 + 4 * kRotor_kg * std::pow(0.01 - height_m, 2) +
                               kBody_kg * height_m * height_m;
  EXPECT_NEAR(model.base.inertia_kg_m2(0, 0), 0.007 + lateral_kg_m2, 1e-9);
  for (const double thrust_n : model.HoverInput()) EXPECT_NEAR(thrust_n, kMass_kg * 9.81 / 4, 1e-9);
  EXPECT_LT(Unbalance(model, std::vector<double>(4, kMass_kg * 9.81 / 4)), 1e-9);
}

// RotorS, component_snippets.xacro: the density of the white noise, sampled with its worlds' step of 0.01 s.
TEST(ShippedVehicles, TheQuadrotorsSensorsHaveThePublishedNoise) {
  const VehicleModel model = LoadShipped("quadrotor");
  ASSERT_EQ(model.sensors.size(), 4U);
  const Sensor& imu = model.sensors[0];
  ASSERT_EQ(imu.noise.size(), 6U);
  EXPECT_EQ(imu.rate_hz, 100);
  for (std::size_t i = 0; i < 3; ++i) {
    const SensorNoise &acc = imu.noise[i], &gyro = imu.noise[3 + i];
    EXPECT_NEAR(acc.stddev, 0.004 / std::sqrt(0.01), 1e-12);
    EXPECT_NEAR(gyro.stddev, 0.0003394 / std::sqrt(0.01), 1e-12);
    EXPECT_EQ(acc.bias_stddev, 0.196);
    EXPECT_EQ(gyro.bias_stddev, 0.0087);
    EXPECT_EQ(acc.walk_density, 0.006);
    EXPECT_EQ(gyro.walk_density, 0.000038785);
    EXPECT_EQ(acc.walk_time_s, 300);
    EXPECT_EQ(gyro.walk_time_s, 1000);
  }
  // A uniform bias within 4e-7 T has this standard deviation.
  EXPECT_NEAR(model.sensors[1].noise[0].bias_stddev, 4e-7 / std::sqrt(3), 1e-12);
  EXPECT_EQ(model.sensors[1].noise[0].stddev, 8e-8);
  EXPECT_EQ(model.sensors[3].rate_hz, 5);
  std::vector<double> deviations;
  for (const SensorNoise& noise : model.sensors[3].noise) deviations.push_back(noise.stddev);
  EXPECT_THAT(deviations, ElementsAre(3, 3, 6, 0.1, 0.1, 0.1));
}

TEST(ShippedVehicles, TheQuadrotorStandsOnItsFeet) {
  const VehicleModel model = LoadShipped("quadrotor");
  Plant plant(model, {.touch_down_max_m_s = 1});
  plant.ResetOnGround(0, 0, {0, 0, 0});
  std::vector<double> state(model.signals().states.size());
  const std::vector<double> no_thrust(4, 0.0);
  for (int i = 0; i < 500; ++i) plant.Step(no_thrust);
  plant.State(state);
  EXPECT_EQ(plant.Event(), FlightEvent::kNone) << plant.EventText();
  EXPECT_TRUE(plant.OnGround());
  EXPECT_NEAR(state[2], 0.07, 1e-5);  // feet of 0.01 m, 0.06 m below the origin
  for (std::size_t i = 6; i < 12; ++i) EXPECT_NEAR(state[i], 0, 1e-6);
}

TEST(ShippedVehicles, TheHexarotorHasThePublishedTotals) {
  const VehicleModel model = LoadShipped("hexarotor");
  EXPECT_DOUBLE_EQ(model.MassTotal(), 1.535);
  EXPECT_NEAR((model.base.inertia_kg_m2.diagonal() - Eigen::Vector3d(0.0411, 0.0478, 0.0599)).norm(), 0,
              1e-9);
  EXPECT_NEAR(model.base.p_com_m.norm(), 0, 1e-9);
  ASSERT_EQ(model.rotors.size(), 6U);
  for (std::size_t i = 0; i < 6; ++i) {
    const Rotor& rotor = model.rotors[i];
    const double angle_rad = -std::numbers::pi / 3 * static_cast<double>(i);  // clockwise from the front
    EXPECT_NEAR((rotor.p_LR_m - 0.275 * Eigen::Vector3d(std::cos(angle_rad), std::sin(angle_rad), 0)).norm(),
                0, 1e-8);
    EXPECT_EQ(rotor.direction, (std::array{1, 1, -1, -1, 1, -1}[i])) << rotor.name;
  }
  for (const double thrust_n : model.HoverInput()) EXPECT_NEAR(thrust_n, 1.535 * 9.81 / 6, 1e-9);
}

// Du et al., JGCD 2015: in the order PPNNPN some single rotors may fail. Thrusts from moments by hand, in units of
// a quarter of the weight: the other rotors balance roll, pitch and yaw.
TEST(ShippedVehicles, TheHexarotorCanHoverWithoutItsFrontRotor) {
  const VehicleModel model = LoadShipped("hexarotor");
  const double quarter_n = 1.535 * 9.81 / 4;
  // front, front_right, back_right, back, back_left, front_left
  EXPECT_LT(Unbalance(model, {0, quarter_n, quarter_n, 0, quarter_n, quarter_n}), 1e-7);
  EXPECT_LT(Unbalance(model, {0, 1.5 * quarter_n, 0, quarter_n, 0.5 * quarter_n, quarter_n}), 1e-7);
  EXPECT_LT(1.5 * quarter_n, 6.125);
  EXPECT_GT(Unbalance(model, {0, quarter_n, quarter_n, quarter_n, 0, quarter_n}), 0.1);
}

// The available control authority index of Du et al. (arXiv:1403.5986v3, section III): the radius of the largest
// ball around hover within the attainable thrusts and moments. These are the image of a box, so each facet is normal
// to three rotors' columns. `directions`: +1 clockwise, seen from above. `failed`: a rotor, or -1. In N and N m.
double ControlAuthority(const VehicleModel& model, std::span<const double> directions, int failed) {
  constexpr double kStandardGravity_m_s2 = 9.80665;
  Eigen::Matrix<double, 4, 6> effect;
  for (int i = 0; i < 6; ++i) {
    const Rotor& rotor = model.rotors[static_cast<std::size_t>(i)];
    const Eigen::Vector3d& p_m = rotor.p_LR_m;
    effect.col(i) << 1, p_m.y(), -p_m.x(), directions[static_cast<std::size_t>(i)] * rotor.drag_ratio_m;
    effect.col(i) *= i == failed ? 0 : rotor.force_max_n / 2;
  }
  const Eigen::Vector4d hover =
      Eigen::Vector4d(model.MassTotal() * kStandardGravity_m_s2, 0, 0, 0) - effect.rowwise().sum();
  double radius = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < i; ++j) {
      for (int k = 0; k < j; ++k) {
        Eigen::Matrix<double, 3, 4> facet;
        facet << effect.col(i).transpose(), effect.col(j).transpose(), effect.col(k).transpose();
        const Eigen::JacobiSVD<Eigen::MatrixXd> svd(facet, Eigen::ComputeFullV);
        if (svd.singularValues()[2] < 1e-9) continue;
        const Eigen::Vector4d normal = svd.matrixV().col(3);
        radius =
            std::min(radius, (normal.transpose() * effect).cwiseAbs().sum() - std::abs(normal.dot(hover)));
      }
    }
  }
  return radius;
}

// Mass, arm, largest thrust and drag ratio together decide these indices. They are from the tests of an independent
// public calculation, which follows the authors' Matlab files (dmkeijzer/RBDOWigeon-paper, stab_and_ctrl).
TEST(ShippedVehicles, TheHexarotorHasThePublishedControlAuthority) {
  const VehicleModel model = LoadShipped("hexarotor");
  std::array<double, 6> own{};
  for (std::size_t i = 0; i < 6; ++i) own[i] = model.rotors[i].direction;
  EXPECT_NEAR(ControlAuthority(model, own, -1), 1.1295, 1e-4);
  EXPECT_NEAR(ControlAuthority(model, own, 0), 0.7213, 1e-4);
  EXPECT_LT(ControlAuthority(model, own, 4), 1e-4);
  constexpr std::array<double, 6> kUsual{1, -1, 1, -1, 1, -1};
  EXPECT_NEAR(ControlAuthority(model, kUsual, -1), 1.4861, 1e-4);
  for (int failed = 0; failed < 6; ++failed) EXPECT_NEAR(ControlAuthority(model, kUsual, failed), 0, 1e-4);
}

TEST(ShippedVehicles, TheQuadTiltHangsOnItsHinges) {
  const VehicleModel model = LoadShipped("quad_tilt");
  EXPECT_DOUBLE_EQ(model.MassTotal(), 2);
  ASSERT_EQ(model.hinges.size(), 4U);
  ASSERT_EQ(model.rotors.size(), 4U);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(model.rotors[i].hinge, i);
    EXPECT_EQ(model.hinges[i].name, model.rotors[i].name);
    EXPECT_NEAR(model.HoverInput()[i], 2 * 9.81 / 4, 1e-9);
    EXPECT_NEAR(model.hover.hinge_rad[i], 0, 1e-9);
  }
}

// A positive angle of a hinge about y tilts its thrust towards +x (docs/vehicle.md has the picture).
TEST(ShippedVehicles, APositiveAngleTiltsTheThrustForward) {
  const VehicleModel model = LoadShipped("quad_tilt");
  Coordinates<Complex> q = Coordinates<Complex>::Zero(CoordinateCount(model));
  q.tail(4).setConstant(0.2);
  Inputs<Complex> u = Inputs<Complex>::Zero(InputCount(model));
  u.head(4).setConstant(5);
  const auto motion =
      ComputeEquationsOfMotion(model, q, Coordinates<Complex>::Zero(CoordinateCount(model)), u);
  EXPECT_NEAR(motion.force[0].real(), 20 * std::sin(0.2), 1e-9);
}

// Direction 1 is a propeller that turns clockwise, seen from above: its drag turns the body counter-clockwise.
TEST(ShippedVehicles, DirectionOneTurnsTheBodyToTheLeft) {
  VehicleModel model = LoadShipped("quadrotor");
  for (Rotor& rotor : model.rotors) rotor.time_constant_up_s = rotor.time_constant_down_s = 0;
  Plant plant(model, {});
  std::vector<double> input = model.HoverInput();
  for (std::size_t i = 0; i < 4; ++i) input[i] += 0.1 * model.rotors[i].direction;
  for (int i = 0; i < 25; ++i) plant.Step(input);
  std::vector<double> state(12);
  plant.State(state);
  // 0.4 N on 0.016 m, for 0.1 s.
  EXPECT_NEAR(state[11], 0.4 * 0.016 / model.base.inertia_kg_m2(2, 2) * 0.1, 1e-4);
}

}  // namespace
}  // namespace tiltproof::plant
