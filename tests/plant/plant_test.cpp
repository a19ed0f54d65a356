// The plant's single properties: frames, conservation laws, saturation, events, determinism.
#include "plant/plant.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <numbers>

#include "link/check.h"
#include "tests/plant/models.h"
#include "tests/support/tiltrotor_plant.h"

namespace tiltproof::plant {
namespace {

using testing::ActuatorsOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;
using testing::TiltrotorPlant;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

ActuatorsTruth Hovering() { return ActuatorsOf(Model().HoverInput()); }

// A state with everything in motion, high up.
SensorsTruth Tumble() {
  return {.x_m = 1,
          .y_m = -2,
          .z_m = 30,
          .roll_rad = 0.3,
          .pitch_rad = -0.4,
          .yaw_rad = 2.5,
          .alpha_r_rad = 0.2,
          .alpha_l_rad = -0.3,
          .vx_m_s = 1,
          .vy_m_s = 2,
          .vz_m_s = 3,
          .wx_rad_s = 0.5,
          .wy_rad_s = -0.8,
          .wz_rad_s = 1.1,
          .alpha_r_rad_s = 0.7,
          .alpha_l_rad_s = -0.6};
}

Eigen::Matrix3d Attitude(const SensorsTruth& s) {
  return (Eigen::AngleAxisd(s.yaw_rad, Eigen::Vector3d::UnitZ()) *
          Eigen::AngleAxisd(s.pitch_rad, Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(s.roll_rad, Eigen::Vector3d::UnitX()))
      .toRotationMatrix();
}

TEST(Plant, StateIsWhatResetPlaced) {
  TiltrotorPlant plant(Model(), {});
  plant.Reset(Tumble());
  const SensorsTruth state = plant.State(), expected = Tumble();
  for (const auto& field : kSensorFields) {
    EXPECT_NEAR(state.*field.in_double, expected.*field.in_double, 1e-12) << field.column;
  }
  EXPECT_LT(plant.HingeGap(), 1e-12);
}

TEST(Plant, ResetPutsTheServosAtHover) {
  TiltrotorPlant plant(Model(), {});
  plant.Reset({2, 0, 0.5}, {0.1, 0.2, 0.3});
  const SensorsTruth state = plant.State();
  EXPECT_NEAR(state.alpha_r_rad, Model().hover.hinge_rad[0], 1e-12);
  EXPECT_NEAR(state.alpha_l_rad, Model().hover.hinge_rad[1], 1e-12);
  EXPECT_NEAR(state.x_m, 2, 1e-12);
  EXPECT_NEAR(state.z_m, 0.5, 1e-12);
  EXPECT_NEAR(state.pitch_rad, 0.2, 1e-12);
  EXPECT_EQ(state.vx_m_s, 0);
  EXPECT_EQ(state.wz_rad_s, 0);
}

TEST(Plant, HoverInputHolds) {
  TiltrotorPlant plant(Model(), {});
  plant.Reset({0, 0, 5}, {Model().hover.roll_rad, Model().hover.pitch_rad, 0});
  for (int i = 0; i < 250; ++i) plant.Step(Hovering());
  const SensorsTruth state = plant.State();
  EXPECT_NEAR(state.x_m, 0, 1e-6);
  EXPECT_NEAR(state.y_m, 0, 1e-6);
  EXPECT_NEAR(state.z_m, 5, 1e-6);
  EXPECT_NEAR(state.alpha_r_rad, Model().hover.hinge_rad[0], 1e-6);
}

TEST(Plant, RatesAreTheDerivativesOfPositionsAndAngles) {
  const PlantOptions options{.step_ns = 10 * kNsPerUs};
  TiltrotorPlant plant(Model(), options);
  plant.Reset(Tumble());
  const double h = ToSeconds(options.step_ns);
  for (int i = 0; i < 50; ++i) plant.Step(Hovering());
  const SensorsTruth before = plant.State();
  plant.Step(Hovering());
  const SensorsTruth world = plant.State(), body = plant.State(RatesFrame::kBody),
                     euler = plant.State(RatesFrame::kEuler);
  constexpr double kTolerance = 1e-3;
  EXPECT_NEAR((world.x_m - before.x_m) / h, world.vx_m_s, kTolerance);
  EXPECT_NEAR((world.y_m - before.y_m) / h, world.vy_m_s, kTolerance);
  EXPECT_NEAR((world.z_m - before.z_m) / h, world.vz_m_s, kTolerance);
  EXPECT_NEAR((world.alpha_r_rad - before.alpha_r_rad) / h, world.alpha_r_rad_s, kTolerance);
  EXPECT_NEAR((world.alpha_l_rad - before.alpha_l_rad) / h, world.alpha_l_rad_s, kTolerance);
  EXPECT_NEAR((world.roll_rad - before.roll_rad) / h, euler.wx_rad_s, kTolerance);
  EXPECT_NEAR((world.pitch_rad - before.pitch_rad) / h, euler.wy_rad_s, kTolerance);
  EXPECT_NEAR((world.yaw_rad - before.yaw_rad) / h, euler.wz_rad_s, kTolerance);
  // R' R^T is the skew matrix of the world rates, R^T R' that of the body rates.
  const Eigen::Matrix3d R = Attitude(world), R_rate = (R - Attitude(before)) / h;
  const Eigen::Matrix3d in_world = R_rate * R.transpose(), in_body = R.transpose() * R_rate;
  EXPECT_NEAR(in_world(2, 1), world.wx_rad_s, kTolerance);
  EXPECT_NEAR(in_world(0, 2), world.wy_rad_s, kTolerance);
  EXPECT_NEAR(in_world(1, 0), world.wz_rad_s, kTolerance);
  EXPECT_NEAR(in_body(2, 1), body.wx_rad_s, kTolerance);
  EXPECT_NEAR(in_body(0, 2), body.wy_rad_s, kTolerance);
  EXPECT_NEAR(in_body(1, 0), body.wz_rad_s, kTolerance);
  // The three really differ here.
  EXPECT_GT(std::abs(world.wx_rad_s - body.wx_rad_s), 0.1);
  EXPECT_GT(std::abs(body.wx_rad_s - euler.wx_rad_s), 0.1);
}

TEST(Plant, ThrustLiftsAndServosTurnTheWayTheySay) {
  TiltrotorPlant plant(Model(), {});
  plant.Reset({0, 0, 5}, {0, 0, 0});
  ActuatorsTruth input = Hovering();
  input.f_r_n += 1;
  plant.Step(input);
  EXPECT_GT(plant.State().vz_m_s, 1e-4);
  EXPECT_LT(plant.State().wx_rad_s, -1e-3);  // the right thruster is at -y: it lifts that side

  plant.Reset({0, 0, 5}, {0, 0, 0});
  input = Hovering();
  input.tau_l_nm = 1e-3;
  plant.Step(input);
  EXPECT_NEAR(plant.State().alpha_l_rad_s, 1e-3 / 1.05e-4 * 0.004, 5e-3);
  EXPECT_NEAR(plant.State().alpha_r_rad_s, 0, 1e-3);
  EXPECT_LT(plant.State().wy_rad_s, 0);  // the reaction
}

TEST(Plant, WithoutForcesMomentumIsConserved) {
  TiltrotorPlant plant(Model(), {.step_ns = kNsPerMs, .gravity_m_s2 = 0, .ground = false});
  plant.Reset(Tumble());
  const std::array<double, 6> before = plant.Momentum();
  const double energy = plant.Energy();
  for (int i = 0; i < 1000; ++i) plant.Step({});
  const std::array<double, 6> after = plant.Momentum();
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(after[i], before[i], 1e-9);
  // The engine's integration of rotations is of first order.
  const double scale = std::hypot(before[3], before[4], before[5]);
  for (std::size_t i = 3; i < 6; ++i) EXPECT_NEAR(after[i], before[i], 1e-4 * scale);
  EXPECT_NEAR(plant.Energy(), energy, 1e-3 * energy);
}

TEST(Plant, EnergyErrorShrinksWithTheStep) {
  const auto error = [](TimeNs step_ns) {
    TiltrotorPlant plant(Model(), {.step_ns = step_ns, .gravity_m_s2 = 0, .ground = false});
    SensorsTruth state = Tumble();
    state.vx_m_s = state.vy_m_s = state.vz_m_s = 0;
    plant.Reset(state);
    const double before = plant.Energy();
    for (TimeNs t = 0; t < kNsPerS; t += step_ns) plant.Step({});
    return std::abs(plant.Energy() / before - 1);
  };
  EXPECT_LT(error(4 * kNsPerMs), 2e-2);
  EXPECT_LT(error(kNsPerMs), 0.5 * error(4 * kNsPerMs));
}

TEST(Plant, FallsFreely) {
  TiltrotorPlant plant(Model(), {.step_ns = 4 * kNsPerMs, .gravity_m_s2 = kGravity_m_s2, .ground = false});
  plant.Reset({0, 0, 0}, {0, 0, 0});
  const double energy = plant.Energy(), mass = Model().MassTotal();
  for (int i = 0; i < 250; ++i) plant.Step({});
  EXPECT_NEAR(plant.Momentum()[2], -mass * kGravity_m_s2, 1e-9);
  EXPECT_NEAR(plant.State().z_m, -0.5 * kGravity_m_s2, 0.5 * kGravity_m_s2 * 4e-3 + 1e-9);
  // The velocity is a half step ahead of the position: m g v h / 2.
  EXPECT_NEAR(plant.Energy(), energy, mass * kGravity_m_s2 * kGravity_m_s2 * 4e-3 / 2 + 1e-6);
}

TEST(Plant, SaturatesEveryInputAtItsLimits) {
  TiltrotorPlant plant(Model(), {});
  EXPECT_EQ(plant.InputInForce({31, -1, 3, -3}), (ActuatorsTruth{30, 0, 2, -2}));
  EXPECT_EQ(plant.InputInForce({5, 6, 1, -1}), (ActuatorsTruth{5, 6, 1, -1}));
  constexpr double inf = std::numeric_limits<double>::infinity();
  EXPECT_EQ(plant.InputInForce({inf, -inf, inf, -inf}), (ActuatorsTruth{30, 0, 2, -2}));
  // An input that exceeds a limit moves the vehicle as the limit does.
  plant.Step({31, -1, 3, -3});
  TiltrotorPlant other(Model(), {});
  other.Step({30, 0, 2, -2});
  EXPECT_EQ(plant.State(), other.State());
}

TEST(Plant, StopsHoldTheHinges) {
  TiltrotorPlant plant(Model(), {.gravity_m_s2 = 0, .ground = false});
  plant.Reset({0, 0, 0}, {0, 0, 0});
  double largest = 0;
  for (int i = 0; i < 250; ++i) {
    plant.Step({0, 0, 0.002, -0.002});
    largest = std::max({largest, plant.State().alpha_r_rad, -plant.State().alpha_l_rad});
  }
  EXPECT_LT(largest, 1.5 + 0.05);  // one step at the speed of impact
  EXPECT_NEAR(plant.State().alpha_r_rad, 1.5, 1e-3);
  EXPECT_NEAR(plant.State().alpha_l_rad, -1.5, 1e-3);
  EXPECT_LT(plant.HingeGap(), 1e-4);
}

TEST(Plant, GroundStrikeIsSeenAndHolds) {
  TiltrotorPlant plant(Model(), {});
  plant.Reset({0, 0, 0.5}, {0, 0, 0});
  EXPECT_EQ(plant.Event(), FlightEvent::kNone);
  EXPECT_EQ(plant.EventText(), "");
  // Falls 0.39 m: 0.28 s.
  int steps = 0;
  while (plant.Event() == FlightEvent::kNone && ++steps < 1000) plant.Step({});
  EXPECT_EQ(plant.Event(), FlightEvent::kGroundStrike);
  EXPECT_THAT(plant.EventText(), HasSubstr("'body' touches the ground"));
  EXPECT_NEAR(steps * 0.004, std::sqrt(2 * (0.5 - 0.113) / kGravity_m_s2), 0.01);
  // It comes to rest on the ground, and the event stays.
  for (int i = 0; i < 1000; ++i) plant.Step({});
  EXPECT_EQ(plant.Event(), FlightEvent::kGroundStrike);
  EXPECT_GT(plant.State().z_m, 0);
  EXPECT_LT(plant.State().z_m, 0.5);
  EXPECT_LT(std::abs(plant.State().vz_m_s), 0.1);
  plant.Reset({0, 0, 0.5}, {0, 0, 0});
  EXPECT_EQ(plant.Event(), FlightEvent::kNone);
}

TEST(Plant, EveryShapeMeetsTheGroundWhereItIs) {
  VehicleModel model = Model();
  model.collision.p_BS_m = {0, 0, -0.2};
  const auto height_of_contact = [&model] {
    TiltrotorPlant plant(model, {});
    double low = 0, high = 2;
    while (high - low > 1e-6) {
      const double middle = 0.5 * (low + high);
      plant.Reset({0, 0, middle}, {0, 0, 0});
      (plant.Event() == FlightEvent::kGroundStrike ? low : high) = middle;
    }
    return high;
  };
  model.collision.kind = CollisionShape::Kind::kBox;
  model.collision.size_m = {0.1, 0.2, 0.3};
  EXPECT_NEAR(height_of_contact(), 0.35, 1e-5);
  model.collision.kind = CollisionShape::Kind::kSphere;
  model.collision.size_m = {0.25, 0, 0};
  EXPECT_NEAR(height_of_contact(), 0.45, 1e-5);
  model.collision.kind = CollisionShape::Kind::kCylinder;
  model.collision.size_m = {0.1, 0.5, 0};
  EXPECT_NEAR(height_of_contact(), 0.45, 1e-5);
}

TEST(Plant, SurvivesServosAtTheirLimits) {
  TiltrotorPlant plant(Model(), {.ground = false});
  plant.Reset({0, 0, 50}, {0, 0, 0});
  for (int i = 0; i < 500; ++i) {
    const double torque = i / 10 % 2 == 0 ? 2 : -2;
    plant.Step({30, 30, torque, -torque});
  }
  EXPECT_NE(plant.Event(), FlightEvent::kNotFinite);
}

TEST(Plant, NoGroundNoStrike) {
  TiltrotorPlant plant(Model(), {.ground = false});
  plant.Reset({0, 0, -5}, {0, 0, 0});
  plant.Step(Hovering());
  EXPECT_EQ(plant.Event(), FlightEvent::kNone);
}

TEST(Plant, TooFarAndTilted) {
  TiltrotorPlant plant(Model(), {});
  plant.Reset({0, 0, 999}, {0, 0, 0});
  EXPECT_EQ(plant.Event(), FlightEvent::kNone);
  plant.Reset({0, 700, 800}, {0, 0, 0});
  EXPECT_EQ(plant.Event(), FlightEvent::kTooFar);
  EXPECT_THAT(plant.EventText(), HasSubstr("1063 m"));
  plant.Reset({0, 0, 5}, {1.56, 0, 0});
  EXPECT_EQ(plant.Event(), FlightEvent::kNone);
  plant.Reset({0, 0, 5}, {1.6, 0, 0});
  EXPECT_EQ(plant.Event(), FlightEvent::kTilted);
  EXPECT_THAT(plant.EventText(), HasSubstr("91.7 deg"));
}

TEST(Plant, InputThatIsNotANumberStopsThePlant) {
  TiltrotorPlant plant(Model(), {});
  plant.Step(Hovering());
  const SensorsTruth before = plant.State();
  plant.Step({kNaN, 10, 0, 0});
  EXPECT_EQ(plant.Event(), FlightEvent::kNotFinite);
  EXPECT_THAT(plant.EventText(), HasSubstr("f_r_n"));
  plant.Step(Hovering());
  EXPECT_EQ(plant.State(), before);
  plant.Reset({0, 0, 1}, {0, 0, 0});
  EXPECT_EQ(plant.Event(), FlightEvent::kNone);
}

TEST(Plant, StartThatIsNotANumberIsRefused) {
  TiltrotorPlant plant(Model(), {});
  EXPECT_THROW(plant.Reset({kNaN, 0, 1}, {0, 0, 0}), PlantError);
  EXPECT_THROW(plant.Reset({0, 0, 1}, {0, 0, INFINITY}), PlantError);
  EXPECT_THROW(Plant(Model(), {.step_ns = 0}), PlantError);
}

TEST(Plant, BlowUpIsAnEventNotACrash) {
  VehicleModel model = Model();
  for (Rotor& rotor : model.rotors) rotor.force_max_n = 1e300;
  for (Hinge& hinge : model.hinges) hinge.torque_max_nm = 1e300;
  TiltrotorPlant plant(model, {});
  plant.Reset({0, 0, 5}, {0, 0, 0});
  for (int i = 0; i < 100; ++i) plant.Step({1e300, 1e299, 1e300, -1e300});
  EXPECT_EQ(plant.Event(), FlightEvent::kNotFinite);
  EXPECT_NE(plant.EventText(), "");
  TiltrotorPlant other(Model(), {});  // not harmed by its neighbour
  for (int i = 0; i < 10; ++i) other.Step(Hovering());
  EXPECT_EQ(other.Event(), FlightEvent::kNone);
  plant.Reset({0, 0, 5}, {0, 0, 0});
  plant.Step(Hovering());
  EXPECT_EQ(plant.Event(), FlightEvent::kNone);
  EXPECT_NEAR(plant.State().z_m, 5, 1e-3);
}

TEST(Plant, InertiaThatTheEngineCannotIntegrateIsRefusedByName) {
  VehicleModel model = Model();
  model.hinges[1].body.inertia_kg_m2(0, 0) = -1;
  try {
    const TiltrotorPlant plant(model, {});
    FAIL() << "made a plant";
  } catch (const PlantError& error) {
    EXPECT_THAT(error.what(), HasSubstr("'thruster_left'"));
  }
}

TEST(Plant, SameCallsSameBits) {
  TiltrotorPlant first(Model(), {});
  first.Reset(Tumble());
  for (int i = 0; i < 100; ++i) first.Step({});  // another past
  TiltrotorPlant second(Model(), {});
  for (TiltrotorPlant* plant : {&first, &second}) plant->Reset({0, 0, 0.3}, {0.1, 0.05, 0.2});
  for (int i = 0; i < 2000; ++i) {  // into the ground and beyond
    const ActuatorsTruth input = {10 + std::sin(0.01 * i), 10, 0.001 * std::cos(0.02 * i), 0};
    first.Step(input);
    second.Step(input);
    ASSERT_EQ(first.State(), second.State()) << i;
  }
  EXPECT_NE(first.Event(), FlightEvent::kNone);
}

TEST(Plant, RowOfAnotherSizeIsRefused) {
  Plant plant(Model(), {});
  std::vector<double> row(3);
  EXPECT_THAT([&] { plant.Step(row); },
              ThrowsMessage<BrokenInvariant>(HasSubstr("a row of inputs has 4 numbers, not 3")));
  EXPECT_THAT([&] { plant.State(row); },
              ThrowsMessage<BrokenInvariant>(HasSubstr("a row of states has 16 numbers, not 3")));
}

TEST(Plant, YawIsWrapped) {
  TiltrotorPlant plant(Model(), {});
  plant.Reset({0, 0, 5}, {0, 0, 3 * std::numbers::pi / 2});
  EXPECT_NEAR(plant.State().yaw_rad, -std::numbers::pi / 2, 1e-12);
  plant.Reset({0, 0, 5}, {0, 0, -std::numbers::pi});
  EXPECT_GT(plant.State().yaw_rad, -std::numbers::pi);
}

TEST(Plant, SensorsHoldTheirSampleBetweenTwo) {
  VehicleModel model = Model();
  model.sensor_rate_hz = 100;  // every 10 ms: at 0, 12, 20 ms of a 4 ms grid
  TiltrotorPlant plant(model, {});
  plant.Reset(Tumble());
  const SensorsTruth at_0 = plant.State(RatesFrame::kBody);
  EXPECT_EQ(plant.ReadSensors(RatesFrame::kBody), at_0);
  plant.Step({});
  plant.Step({});
  EXPECT_EQ(plant.ReadSensors(RatesFrame::kBody), at_0);
  plant.Step({});
  const SensorsTruth at_12 = plant.State();
  EXPECT_EQ(plant.ReadSensors(), at_12);
  plant.Step({});
  EXPECT_EQ(plant.ReadSensors(), at_12);
  plant.Step({});
  EXPECT_EQ(plant.ReadSensors(), plant.State());

  TiltrotorPlant every_step(Model(), {});
  every_step.Step({});
  EXPECT_EQ(every_step.ReadSensors(), every_step.State());
}

}  // namespace
}  // namespace tiltproof::plant
