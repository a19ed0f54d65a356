// Values of messages against rotations by Eigen.
#include "harness/run/message_binding.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "harness/reference/reference_point.h"
#include "harness/scenario/shipped_protocols.h"
#include "tests/harness/run/by_hand.h"

namespace tiltproof::harness {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using ::testing::HasSubstr;

constexpr double kTolerance = 1e-12;

// The tilt-rotor with one IMU and one magnetometer, and a second IMU.
VehicleSignals Vehicle() {
  plant::VehicleModel model = Model();
  model.sensors = {{.kind = plant::SensorKind::kImu, .name = "a"},
                   {.kind = plant::SensorKind::kImu, .name = "b"},
                   {.kind = plant::SensorKind::kMagnetometer, .name = "m"},
                   {.kind = plant::SensorKind::kGnss, .name = "g"}};
  return model.signals();
}

// A protocol with one message that carries these.
link::Protocol Carrying(link::Direction direction, const std::vector<link::MessageField>& fields,
                        link::WorldAxes world = link::WorldAxes::kEnu,
                        link::BodyAxes body = link::BodyAxes::kFlu) {
  link::Protocol protocol;
  protocol.name = "test";
  protocol.world = world;
  protocol.body = body;
  const auto kind =
      direction == link::Direction::kToPlant ? link::MessageKind::kActuators : link::MessageKind::kReply;
  protocol.messages = {
      link::LayOut({.name = "message", .kind = kind, .direction = direction, .fields = fields})};
  return protocol;
}
link::Protocol Carrying(link::Direction direction, const std::vector<std::string>& signals,
                        link::WorldAxes world, link::BodyAxes body) {
  std::vector<link::MessageField> fields;
  for (const std::string& signal : signals)
    fields.push_back({.signal = signal, .type = link::NumberType::kF64});
  return Carrying(direction, fields, world, body);
}

// The pairs of axes, as rotations from the vehicle's.
struct Axes {
  link::WorldAxes world;
  link::BodyAxes body;
  Matrix3d T, B;
};
std::vector<Axes> AllAxes() {
  Matrix3d ned, frd;
  ned << 0, 1, 0, 1, 0, 0, 0, 0, -1;
  frd << 1, 0, 0, 0, -1, 0, 0, 0, -1;
  std::vector<Axes> all;
  for (const auto world : {link::WorldAxes::kEnu, link::WorldAxes::kNed})
    for (const auto body : {link::BodyAxes::kFlu, link::BodyAxes::kFrd})
      all.push_back({world, body, world == link::WorldAxes::kNed ? ned : Matrix3d::Identity(),
                     body == link::BodyAxes::kFrd ? frd : Matrix3d::Identity()});
  return all;
}

Matrix3d RotationOf(const Vector3d& angles) {
  return (Eigen::AngleAxisd(angles[2], Vector3d::UnitZ()) * Eigen::AngleAxisd(angles[1], Vector3d::UnitY()) *
          Eigen::AngleAxisd(angles[0], Vector3d::UnitX()))
      .toRotationMatrix();
}

// Angular velocity along the body's axes: each angle turns about an axis of its own (of the yawed, pitched, rolled body).
Vector3d BodyRates(const Vector3d& angles, const Vector3d& derivatives) {
  const Matrix3d R = RotationOf(angles);
  const Vector3d w = derivatives[2] * Vector3d::UnitZ() +
                     derivatives[1] * (Eigen::AngleAxisd(angles[2], Vector3d::UnitZ()) * Vector3d::UnitY()) +
                     derivatives[0] * (R * Vector3d::UnitX());
  return R.transpose() * w;
}

// A row of random sensors whose angles are these.
std::vector<double> RowAt(const VehicleSignals& vehicle, const Vector3d& angles, std::mt19937& engine) {
  std::vector<double> row;
  for (std::size_t i = 0; i < vehicle.sensors.size(); ++i)
    row.push_back(static_cast<double>(engine()) / static_cast<double>(engine.max()) * 4 - 2);
  for (const auto& [name, axis] : {std::pair{"roll_rad", 0}, {"pitch_rad", 1}, {"yaw_rad", 2}})
    row[*vehicle.sensors.Find(name)] = angles[axis];
  return row;
}

Vector3d Three(const VehicleSignals& vehicle, const std::vector<double>& row,
               const std::array<std::string, 3>& names) {
  return {row[*vehicle.sensors.Find(names[0])], row[*vehicle.sensors.Find(names[1])],
          row[*vehicle.sensors.Find(names[2])]};
}

std::vector<double> Sent(const Axes& axes, const VehicleSignals& vehicle,
                         const std::vector<std::string>& signals, const std::vector<double>& row,
                         AngularRates rates = AngularRates::kWorld) {
  const link::Protocol protocol = Carrying(link::Direction::kToClient, signals, axes.world, axes.body);
  return MessageBinding(protocol, protocol.messages[0], vehicle.sensors, rates).Values(row);
}
Vector3d SentThree(const Axes& axes, const VehicleSignals& vehicle, const std::array<std::string, 3>& signals,
                   const std::vector<double>& row, AngularRates rates = AngularRates::kWorld) {
  const std::vector<double> values = Sent(axes, vehicle, {signals.begin(), signals.end()}, row, rates);
  return {values[0], values[1], values[2]};
}

constexpr std::size_t kDraws = 300;
template <class Visit>
void ForEachDraw(const Visit& visit) {
  std::mt19937 engine(5);
  const VehicleSignals vehicle = Vehicle();
  const auto turn = [&engine] {
    return (static_cast<double>(engine()) / static_cast<double>(engine.max()) * 2 - 1) * std::numbers::pi;
  };
  for (const Axes& axes : AllAxes()) {
    for (std::size_t draw = 0; draw < kDraws; ++draw) {
      // Pitch stays away from a quarter turn, where Z-Y-X angles are not unique.
      const Vector3d angles(turn(), turn() / 2.1, turn());
      visit(axes, vehicle, angles, RowAt(vehicle, angles, engine));
    }
  }
}

TEST(MessageBinding, TurnsVectorsOfTheWorldAndOfTheBody) {
  ForEachDraw([](const Axes& axes, const VehicleSignals& vehicle, const Vector3d&,
                 const std::vector<double>& row) {
    using Names = std::array<std::string, 3>;
    for (const Names& names : {Names{"x_m", "y_m", "z_m"}, Names{"vx_m_s", "vy_m_s", "vz_m_s"},
                               Names{"wx_rad_s", "wy_rad_s", "wz_rad_s"}})
      EXPECT_LT((SentThree(axes, vehicle, names, row) - axes.T * Three(vehicle, row, names)).norm(),
                kTolerance);
    for (const Names& names :
         {Names{"acc_x_m_s2", "acc_y_m_s2", "acc_z_m_s2"},
          Names{"gyro_x_rad_s", "gyro_y_rad_s", "gyro_z_rad_s"},
          Names{"acc_b_x_m_s2", "acc_b_y_m_s2", "acc_b_z_m_s2"}, Names{"mag_x_t", "mag_y_t", "mag_z_t"}})
      EXPECT_LT((SentThree(axes, vehicle, names, row) - axes.B * Three(vehicle, row, names)).norm(),
                kTolerance);
    const Names body = {"wx_rad_s", "wy_rad_s", "wz_rad_s"};
    EXPECT_LT((SentThree(axes, vehicle, body, row, AngularRates::kBody) - axes.B * Three(vehicle, row, body))
                  .norm(),
              kTolerance);
    for (const char* same : {"alpha_r_rad", "alpha_l_rad_s", "gnss_vn_m_s", "gnss_alt_m"})
      EXPECT_EQ(Sent(axes, vehicle, {same}, row)[0], row[*vehicle.sensors.Find(same)]);
  });
}

TEST(MessageBinding, AnglesAndQuaternionsAreTheAttitudeBetweenTheProtocolsAxes) {
  ForEachDraw([](const Axes& axes, const VehicleSignals& vehicle, const Vector3d& angles,
                 const std::vector<double>& row) {
    const Matrix3d expected = axes.T * RotationOf(angles) * axes.B.transpose();
    const Vector3d sent = SentThree(axes, vehicle, {"roll_rad", "pitch_rad", "yaw_rad"}, row);
    EXPECT_LT((RotationOf(sent) - expected).norm(), kTolerance);
    EXPECT_LE(sent.cwiseAbs().maxCoeff(), std::numbers::pi);
    const std::vector<double> q =
        Sent(axes, vehicle, {"quaternion_z", "quaternion_w", "quaternion_x", "quaternion_y"}, row);
    EXPECT_GE(q[1], 0);
    EXPECT_NEAR(Vector3d(q[0], q[2], q[3]).squaredNorm() + q[1] * q[1], 1, kTolerance);
    EXPECT_LT((Eigen::Quaterniond(q[1], q[2], q[3], q[0]).toRotationMatrix() - expected).norm(), kTolerance);
  });
}

TEST(MessageBinding, DerivativesOfTheAnglesAreThoseOfTheSentOnes) {
  ForEachDraw([](const Axes& axes, const VehicleSignals& vehicle, const Vector3d& angles,
                 const std::vector<double>& row) {
    const std::array<std::string, 3> names = {"wx_rad_s", "wy_rad_s", "wz_rad_s"};
    const Vector3d sent = SentThree(axes, vehicle, {"roll_rad", "pitch_rad", "yaw_rad"}, row);
    const Vector3d derivatives = SentThree(axes, vehicle, names, row, AngularRates::kEuler);
    EXPECT_LT((BodyRates(sent, derivatives) - axes.B * BodyRates(angles, Three(vehicle, row, names))).norm(),
              1e-11);
  });
}

TEST(MessageBinding, WithoutOtherAxesEveryBitStays) {
  const VehicleSignals vehicle = Vehicle();
  std::vector<std::string> names;
  for (const Signal& signal : vehicle.sensors) names.push_back(signal.name);
  std::vector<double> row(names.size(), -0.0);
  row[5] = 9;  // beyond half a turn, by a fault
  const std::vector<double> values = Sent(AllAxes()[0], vehicle, names, row);
  for (std::size_t i = 0; i < row.size(); ++i) {
    EXPECT_EQ(values[i], row[i]);
    EXPECT_EQ(std::signbit(values[i]), std::signbit(row[i]));
  }
}

// At rest the accelerometer shows the force against gravity, which is down: +z in NED.
TEST(MessageBinding, GravityIsAlongPlusZInNed) {
  const VehicleSignals vehicle = Vehicle();
  std::vector<double> row(vehicle.sensors.size());
  row[*vehicle.sensors.Find("acc_z_m_s2")] = 9.81;
  row[*vehicle.sensors.Find("yaw_rad")] = 0.7;
  const Axes ned = AllAxes()[3];
  const Vector3d force = SentThree(ned, vehicle, {"acc_x_m_s2", "acc_y_m_s2", "acc_z_m_s2"}, row);
  const std::vector<double> q =
      Sent(ned, vehicle, {"quaternion_w", "quaternion_x", "quaternion_y", "quaternion_z"}, row);
  const Vector3d gravity = -(Eigen::Quaterniond(q[0], q[1], q[2], q[3]) * force);
  EXPECT_LT((gravity - Vector3d(0, 0, 9.81)).norm(), kTolerance);
  // A vehicle that looks north has yaw 0; a right turn, seen from above, is a positive yaw rate.
  row[*vehicle.sensors.Find("yaw_rad")] = std::numbers::pi / 2;
  EXPECT_NEAR(Sent(ned, vehicle, {"yaw_rad"}, row)[0], 0, kTolerance);
  row[*vehicle.sensors.Find("wz_rad_s")] = -1;
  EXPECT_EQ(Sent(ned, vehicle, {"wz_rad_s"}, row)[0], 1);
}

TEST(MessageBinding, ReferencesAreInTheAxesOfTheWorld) {
  const link::Protocol protocol =
      Carrying(link::Direction::kReference, {"x_m", "y_m", "z_m", "yaw_rad", "vx_m_s", "vy_m_s", "vz_m_s"},
               link::WorldAxes::kNed, link::BodyAxes::kFrd);
  const MessageBinding binding(protocol, protocol.messages[0], ReferenceSignals());
  const std::vector<double> values = binding.Values(ToRow({{1, 2, 3}, 0.25, {4, 5, 6}}));
  EXPECT_THAT(values, ::testing::ElementsAre(2, 1, -3, std::numbers::pi / 2 - 0.25, 5, 4, -6));
}

TEST(MessageBinding, SharesOfThrustGoBothWays) {
  const VehicleSignals vehicle = Vehicle();
  const double max = vehicle.inputs[0].max;
  const link::Protocol protocol =
      Carrying(link::Direction::kToPlant, {{.signal = "f_r_n", .as = link::ThrustUnit::kShareOfSpeed},
                                           {.signal = "f_l_n", .as = link::ThrustUnit::kShare},
                                           {.signal = "tau_l_nm"}});
  const MessageBinding binding(protocol, protocol.messages[0], vehicle.inputs);
  std::vector<double> row = {9, 9, 9, 9};
  for (const double share : {0.0, 0.3, 0.5, 1.0}) {
    binding.Put(std::vector<double>{share, share, share}, row);
    // A thrust is the largest one times the square of the share of the largest speed.
    EXPECT_NEAR(row[0], max * share * share, kTolerance * max);
    EXPECT_NEAR(row[1], vehicle.inputs[1].max * share, kTolerance * max);
    EXPECT_EQ(row[2], 9);
    EXPECT_EQ(row[3], share);
    for (const double value : binding.Values(row)) EXPECT_NEAR(value, share, kTolerance);
  }
}

TEST(MessageBinding, WhatCannotBeConvertedIsRefusedWithTheReason) {
  const VehicleSignals vehicle = Vehicle();
  const auto reason = [&](link::Direction direction, const link::MessageField& field) {
    const link::Protocol protocol = Carrying(direction, std::vector<link::MessageField>{field});
    const std::string text = UnsuitableProtocol(protocol, vehicle);
    EXPECT_THROW(MessageBinding(protocol, protocol.messages[0], TableOf(protocol.messages[0], vehicle)),
                 std::invalid_argument);
    return text;
  };
  EXPECT_THAT(reason(link::Direction::kToPlant, {.signal = "tau_r_nm", .as = link::ThrustUnit::kShare}),
              HasSubstr("'tau_r_nm' is not the thrust of a rotor, and has no share"));
  EXPECT_THAT(reason(link::Direction::kToPlant, {.signal = "quaternion_w"}),
              HasSubstr("only the server's messages have the attitude"));
  EXPECT_THAT(
      reason(link::Direction::kReference, {.signal = "roll_rad"}),
      HasSubstr("carries 'roll_rad', and a reference has x_m, y_m, z_m, yaw_rad, vx_m_s, vy_m_s, vz_m_s"));
  EXPECT_THAT(reason(link::Direction::kToClient, {.signal = "pressure_pa"}),
              HasSubstr("its messages carry pressure_pa, which this vehicle does not have"));
}

TEST(UnsuitableProtocol, TakesTheInputsOfAllActuatorMessagesTogether) {
  const VehicleSignals vehicle = Model().signals();
  link::Protocol protocol = *FindProtocol("paper");
  link::MessageType& actuators = protocol.messages[2];
  ASSERT_EQ(actuators.kind, link::MessageKind::kActuators);
  link::MessageType torques = actuators;
  torques.name = "torques";
  torques.id = link::FloatId(4);
  torques.fields.erase(torques.fields.begin(), torques.fields.begin() + 2);
  actuators.fields.resize(2);
  actuators = link::LayOut(actuators);
  EXPECT_THAT(UnsuitableProtocol(protocol, vehicle),
              HasSubstr("its actuator message does not carry this vehicle's tau_r_nm, tau_l_nm"));
  protocol.messages.push_back(link::LayOut(torques));
  EXPECT_EQ(UnsuitableProtocol(protocol, vehicle), "");
}

}  // namespace
}  // namespace tiltproof::harness
