// Faults on the vehicle, from the scenario's parameters to its motion: the plant is held against Lagrange's
// equations and closed forms.
#include <gtest/gtest.h>

#include <cmath>

#include "faults/registry.h"
#include "faults/schedule.h"
#include "plant/plant.h"
#include "tests/plant/models.h"
#include "tests/plant/rotor_vehicles.h"
#include "tests/support/lagrange_model.h"
#include "tests/support/tiltrotor_plant.h"

namespace tiltproof::plant {
namespace {

using testing::LagrangeModel;
using testing::LagrangeParameters;
using testing::TiltrotorPlant;
using Vector8 = LagrangeModel::Vector8;

faults::FaultSchedule ScheduleOf(const std::string& type,
                                 std::map<std::string, faults::ParameterValue> parameters,
                                 const VehicleModel& model = Model()) {
  faults::FaultSpec spec;
  spec.id = "fault";
  spec.type = type;
  spec.parameters = std::move(parameters);
  return {{spec}, 1, {.signals = model.signals()}};
}

LagrangeModel::State Tilted() {
  LagrangeModel::State state;
  state.q << 1, 2, 30, 0.2, -0.3, 0.5, 0.1, -0.2;
  return state;
}
constexpr ActuatorsTruth kInput{.f_r_n = 12, .f_l_n = 9, .tau_r_nm = 0.001, .tau_l_nm = -0.002};

// Accelerations after one short step from rest.
Vector8 FoundAcceleration(faults::FaultSchedule& schedule) {
  constexpr double kStep_s = 1e-6;
  TiltrotorPlant plant(Model(), {.step_ns = 1000, .ground = false});
  plant.Reset(testing::ToSensors(Tilted()));
  plant.Plant::Step(testing::Row(kInput), schedule.DisturbanceOf(0));
  const SensorsTruth after = plant.State(RatesFrame::kEuler);
  Vector8 found;
  found << after.vx_m_s, after.vy_m_s, after.vz_m_s, after.wx_rad_s, after.wy_rad_s, after.wz_rad_s,
      after.alpha_r_rad_s, after.alpha_l_rad_s;
  return found / kStep_s;
}

void ExpectAcceleration(faults::FaultSchedule schedule, const Vector8& expected) {
  const Vector8 found = FoundAcceleration(schedule);
  for (int i = 0; i < 8; ++i) EXPECT_NEAR(found[i], expected[i], 1e-3 * (1 + std::abs(expected[i]))) << i;
}

Vector8 ExpectedAcceleration(const LagrangeParameters& parameters, const ActuatorsTruth& input = kInput) {
  return LagrangeModel(parameters).Acceleration(Tilted().q, Tilted().q_dot, input);
}

TEST(PlantFaults, MassIsThatOfEveryBody) {
  LagrangeParameters parameters = testing::DesignPlant();
  parameters.base.mass_kg *= 1.3;
  for (auto& thruster : parameters.thrusters) thruster.mass_kg *= 1.3;
  ExpectAcceleration(ScheduleOf("plant.mass", {{"factor", 1.3}}), ExpectedAcceleration(parameters));
}

TEST(PlantFaults, InertiaIsThatOfEveryBody) {
  LagrangeParameters parameters = testing::DesignPlant();
  parameters.base.inertia_kg_m2 *= 2.5;
  for (auto& thruster : parameters.thrusters) thruster.inertia_kg_m2 *= 2.5;
  ExpectAcceleration(ScheduleOf("plant.inertia", {{"factor", 2.5}}), ExpectedAcceleration(parameters));
}

TEST(PlantFaults, TheCentreOfMassShiftsInTheBody) {
  LagrangeParameters parameters = testing::DesignPlant();
  parameters.base.com_m += Eigen::Vector3d(0.03, -0.04, 0);
  ExpectAcceleration(
      ScheduleOf("plant.com_shift", {{"shift_m", 0.05}, {"direction", std::array{3.0, -4.0, 0.0}}}),
      ExpectedAcceleration(parameters));
}

// Drag torque and all: as if less were commanded.
TEST(PlantFaults, AWeakRotorGivesLessThrust) {
  ActuatorsTruth less = kInput;
  less.f_l_n *= 0.6;
  ExpectAcceleration(ScheduleOf("plant.thrust", {{"rotor", "left"}, {"factor", 0.6}}),
                     ExpectedAcceleration(testing::DesignPlant(), less));
}

// In space, a free body's angular momentum grows by the torque times its time, along the body's own axis.
TEST(PlantFaults, ATorqueTurnsAboutTheBodysAxis) {
  faults::FaultSchedule schedule = ScheduleOf("plant.torque", {{"torque_nm", 0.02}, {"axis", "y"}});
  TiltrotorPlant plant(Model(), {.step_ns = kNsPerMs, .gravity_m_s2 = 0, .ground = false});
  plant.Reset({}, {0, 0, 0.5});
  for (int n = 0; n < 50; ++n)
    plant.Plant::Step(std::vector<double>(4, 0.0), schedule.DisturbanceOf(n * kNsPerMs));
  const auto momentum = plant.Momentum();
  EXPECT_NEAR(momentum[3], -std::sin(0.5) * 0.02 * 0.05, 1e-6);
  EXPECT_NEAR(momentum[4], std::cos(0.5) * 0.02 * 0.05, 1e-6);
  EXPECT_NEAR(momentum[5], 0, 1e-6);
}

// The relative velocity u of what only quadratic drag slows: m u' = -c u^2, so u = u0 / (1 + c u0 t / m).
TEST(PlantFaults, WindCarriesTheVehicleAlongAsTheDragEquationSays) {
  constexpr double kWind_m_s = 8, kTime_s = 2;
  VehicleModel model = LoadShipped("tiltrotor_drag");
  faults::FaultSchedule schedule =
      ScheduleOf("plant.wind", {{"speed_m_s", kWind_m_s}, {"direction", std::array{0.0, 0.0, 1.0}}}, model);
  TiltrotorPlant plant(model, {.step_ns = kNsPerMs, .gravity_m_s2 = 0, .ground = false});
  plant.Reset({0, 0, 100}, {0, 0, 0});
  for (int n = 0; n < 2000; ++n)
    plant.Plant::Step(std::vector<double>(4, 0.0), schedule.DisturbanceOf(n * kNsPerMs));
  const double mass_kg = model.MassTotal();
  const double left = kWind_m_s / (1 + model.drag.quadratic_n_s2_m2 * kWind_m_s * kTime_s / mass_kg);
  EXPECT_NEAR(plant.Momentum()[2] / mass_kg, kWind_m_s - left, 2e-3);
}

// Lagrange's equations with one joint held: what holds it is the torque that leaves its acceleration 0. The
// acceleration is linear in this torque.
Vector8 HeldAcceleration(const LagrangeModel& model, const Vector8& q, const Vector8& q_dot,
                         ActuatorsTruth input) {
  input.tau_r_nm = 0;
  const Vector8 without = model.Acceleration(q, q_dot, input);
  input.tau_r_nm = 1;
  const Vector8 per_nm = model.Acceleration(q, q_dot, input) - without;
  Vector8 held = without - per_nm * (without[6] / per_nm[6]);
  held[6] = 0;
  return held;
}

TEST(PlantFaults, AJammedJointIsLagrangesModelWithThatJointHeld) {
  const LagrangeModel model(testing::DesignPlant());
  const ActuatorsTruth input{.f_r_n = 10.5, .f_l_n = 10.2, .tau_r_nm = 0.3, .tau_l_nm = 0.001};
  LagrangeModel::State state;
  state.q << 0, 0, 10, 0.05, -0.04, 0.3, 0.06, -0.03;
  faults::FaultSchedule schedule = ScheduleOf("plant.servo_jam", {{"joint", "hinge_right"}});
  TiltrotorPlant plant(Model(), {.step_ns = 100 * kNsPerUs, .ground = false});
  plant.Reset(testing::ToSensors(state));
  constexpr double kStep_s = 1e-3;
  for (int n = 0; n < 400; ++n) {
    for (int k = 0; k < 10; ++k)
      plant.Plant::Step(testing::Row(input), schedule.DisturbanceOf((10 * n + k) * 100 * kNsPerUs));
    const auto slope = [&](const Vector8& q, const Vector8& v) {
      return HeldAcceleration(model, q, v, input);
    };
    const Vector8 q = state.q, v = state.q_dot, a1 = slope(q, v);
    const Vector8 v2 = v + kStep_s / 2 * a1, a2 = slope(q + kStep_s / 2 * v, v2);
    const Vector8 v3 = v + kStep_s / 2 * a2, a3 = slope(q + kStep_s / 2 * v2, v3);
    const Vector8 v4 = v + kStep_s * a3, a4 = slope(q + kStep_s * v3, v4);
    state.q += kStep_s / 6 * (v + 2 * v2 + 2 * v3 + v4);
    state.q_dot += kStep_s / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
  }
  const SensorsTruth expected = testing::ToSensors(state), found = plant.State();
  EXPECT_NEAR(found.alpha_r_rad, 0.06, 1e-6);
  EXPECT_GT(std::abs(expected.alpha_l_rad + 0.03), 1e-3);  // the other one moves
  for (const auto& field : kSensorFields)
    EXPECT_NEAR(found.*field.in_double, expected.*field.in_double, 2e-3) << field.column;
}

TEST(PlantFaults, ARunawayJointTurnsAtItsRate) {
  faults::FaultSchedule schedule =
      ScheduleOf("plant.servo_runaway", {{"joint", "hinge_left"}, {"rate_rad_s", -0.4}});
  TiltrotorPlant plant(Model(), {.step_ns = kNsPerMs, .gravity_m_s2 = 0, .ground = false});
  plant.Reset({.z_m = 10});
  for (int n = 0; n < 500; ++n)
    plant.Plant::Step(std::vector<double>(4, 0.0), schedule.DisturbanceOf(n * kNsPerMs));
  EXPECT_NEAR(plant.State().alpha_l_rad, -0.2, 1e-6);
}

// The state of a vehicle after 100 ms from its hover, with a fault.
std::vector<double> After100ms(const VehicleModel& model, faults::FaultSchedule schedule) {
  Plant plant(model, {.ground = false});
  plant.Reset({0, 0, 50}, {model.hover.roll_rad, model.hover.pitch_rad, 0});
  for (int n = 0; n < 25; ++n) plant.Step(model.HoverInput(), schedule.DisturbanceOf(n * 4 * kNsPerMs));
  std::vector<double> state(model.signals().states.size());
  plant.State(state);
  return state;
}

// A rotor that is out takes its moment away: the body turns to its side, and falls.
TEST(PlantFaults, EachRotorOfAQuadrotorCanBeOut) {
  VehicleModel model = Quadrotor({0, 0, 0});
  model.base.inertia_kg_m2 = Eigen::Vector3d(0.012, 0.014, 0.021).asDiagonal();
  for (std::size_t rotor = 0; rotor < 4; ++rotor) {
    const std::string& name = model.rotors[rotor].name;
    const std::vector<double> state =
        After100ms(model, ScheduleOf("plant.thrust", {{"rotor", name}, {"factor", 0.0}}, model));
    EXPECT_LT(state[8], -0.1) << name;
    EXPECT_GT(state[9] * (name.ends_with("left") ? -1 : 1), 0.1) << name << ": roll to its side";
    EXPECT_GT(state[10] * (name.starts_with("front") ? 1 : -1), 0.1) << name << ": pitch to its side";
    EXPECT_LT(state[11] * model.rotors[rotor].direction, 0) << name << ": its drag is missing";
  }
  EXPECT_THROW(ScheduleOf("plant.thrust", {{"rotor", "right"}, {"factor", 0.0}}, model),
               std::invalid_argument);
  EXPECT_THROW(ScheduleOf("plant.servo_jam", {{"joint", "hinge_right"}}, model), std::invalid_argument);
}

// The inputs by name: thrusts of four rotors, the torque or the angle of one hinge.
TEST(PlantFaults, ActuatorFaultsReachEveryInputByName) {
  for (const ServoMode servo : {ServoMode::kTorque, ServoMode::kPosition}) {
    const VehicleModel model = TailTricopter(servo);
    const std::string hinge = servo == ServoMode::kTorque ? "tau_tail" : "angle_tail";
    for (const auto& [name, place] :
         {std::pair<std::string, std::size_t>{"f_l", 0}, {"f_r", 1}, {"f_tail", 2}, {hinge, 3}}) {
      faults::FaultSchedule schedule =
          ScheduleOf("actuator.hard_over", {{"actuator", name}, {"side", "max"}}, model);
      std::vector<double> input = model.HoverInput(), expected = input;
      schedule.EditInput(0, input, true);
      expected[place] = place < 3 ? 10 : servo == ServoMode::kTorque ? 2 : 1;
      EXPECT_EQ(input, expected) << name;
    }
  }
}

TEST(PlantFaults, AJamHoldsTheOnlyHingeOfATricopter) {
  for (const ServoMode servo : {ServoMode::kTorque, ServoMode::kPosition}) {
    const VehicleModel model = TailTricopter(servo);
    const auto fly = [&](bool jammed) {
      faults::FaultSchedule schedule = jammed
                                           ? ScheduleOf("plant.servo_jam", {{"joint", "tail_joint"}}, model)
                                           : ScheduleOf("plant.mass", {{"factor", 1.0}}, model);
      Plant plant(model, {.ground = false});
      plant.Reset({0, 0, 50}, {0, 0, 0});
      std::vector<double> input = model.HoverInput(), state(14);
      input[3] = 0.3;
      for (int n = 0; n < 50; ++n) plant.Step(input, schedule.DisturbanceOf(n * 4 * kNsPerMs));
      plant.State(state);
      return state[6] - model.hover.hinge_rad[0];
    };
    EXPECT_NEAR(fly(true), 0, 1e-3);
    EXPECT_GT(fly(false), 0.1);
  }
}

// All rotors lose the same: no moment, and the speed -g share t^2 / 2 after t.
TEST(PlantFaults, ABatterySagLowersEveryRotorAlike) {
  for (const VehicleModel& model : {Quadrotor(), Hexarotor()}) {
    const std::vector<double> state =
        After100ms(model, ScheduleOf("plant.battery_sag", {{"share_per_s", 0.5}}, model));
    constexpr double kTime_s = 0.1, kHalfStep_s = 0.002;
    EXPECT_NEAR(state[8], -kG_m_s2 * 0.5 * kTime_s * (kTime_s / 2 - kHalfStep_s), 1e-6) << model.name;
    for (std::size_t i = 9; i < 12; ++i) EXPECT_NEAR(state[i], 0, 1e-6) << model.name;
  }
}

TEST(PlantFaults, PartsAreNamedAsInTheVehiclesFile) {
  EXPECT_EQ(Model().signals().rotors, (std::vector<std::string>{"right", "left"}));
  EXPECT_EQ(Model().signals().joints, (std::vector<std::string>{"hinge_right", "hinge_left"}));
  EXPECT_FALSE(Model().signals().feels_wind);
  EXPECT_TRUE(LoadShipped("tiltrotor_drag").signals().feels_wind);
}

}  // namespace
}  // namespace tiltproof::plant
