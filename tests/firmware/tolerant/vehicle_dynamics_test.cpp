// The firmware's model of motion against the simulated plant: one control period of 12 ms ahead, all along the
// paper's spiral, and from states in which everything turns at once.
#include "firmware/tolerant/vehicle_dynamics.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "firmware/builds.h"
#include "plant/plant.h"

namespace tiltproof::firmware {
namespace {

// The largest differences between model and plant, by kind of signal.
struct Errors {
  double position_m = 0, angle_rad = 0, velocity_m_s = 0, rate_rad_s = 0, hinge_rate_rad_s = 0;

  void Include(const Sensors& model, const std::vector<double>& plant) {
    for (std::size_t i = 0; i < kSensorCount; ++i) {
      double difference = static_cast<double>(model.*kSensorFields[i].in_float) - plant[i];
      if (i >= 3 && i < 6) difference = std::remainder(difference, 2 * std::numbers::pi);
      double& worst = i < 3    ? position_m
                      : i < 8  ? angle_rad
                      : i < 11 ? velocity_m_s
                      : i < 14 ? rate_rad_s
                               : hinge_rate_rad_s;
      worst = std::max(worst, std::abs(difference));
    }
  }
};

class VehicleDynamicsTest : public ::testing::Test {
 protected:
  VehicleDynamicsTest()
      : model_(Load()), plant_(model_, {.step_ns = kModelStepNs, .ground = false}), row_(kSensorCount) {}

  Sensors Sense() {
    plant_.State(row_);
    Sensors sensors;
    for (std::size_t i = 0; i < kSensorCount; ++i) {
      sensors.*kSensorFields[i].in_float = static_cast<float>(row_[i]);
    }
    return sensors;
  }

  // Both move for three steps with the same inputs.
  void ComparePeriod(const Actuators& inputs, Errors& errors) {
    MotionState state = ToMotion(Sense());
    std::vector<double> row;
    for (const auto& field : kActuatorFields) row.push_back(static_cast<double>(inputs.*field.in_float));
    for (int step = 0; step < 3; ++step) {
      StepMotion(kTiltrotorConstants, inputs, state);
      plant_.Step(row);
    }
    plant_.State(row_);
    errors.Include(ToSensors(state), row_);
  }

  static plant::VehicleModel Load() {
    std::vector<std::string> warnings;
    return plant::LoadVehicle(TILTPROOF_SOURCE_DIR "/plant/models/tiltrotor.sdf", {}, warnings);
  }

  plant::VehicleModel model_;
  plant::Plant plant_;
  std::vector<double> row_;
};

TEST_F(VehicleDynamicsTest, SensorsSurviveTheWayToTheModelAndBack) {
  const Sensors sensors{1, -2, 3, 0.2F, -0.3F, 3.1F, 0.1F, -0.2F, 0.5F, 1, -1, 0.4F, -0.6F, 0.8F, 2, -3};
  const Sensors back = ToSensors(ToMotion(sensors));
  for (const auto& field : kSensorFields) {
    EXPECT_NEAR(back.*field.in_float, sensors.*field.in_float, 1e-6) << field.column;
  }
}

TEST_F(VehicleDynamicsTest, PredictsAPeriodOfTheSpiral) {
  plant_.Reset({2, 0, 0.5}, {0, 0, 0});
  const Build& build = *FindBuild("tolerant");
  ControlLaw law(*build.gain, build.feed_forward);
  Errors errors;
  for (int k = 0; k < 2500; ++k) {
    const double t_s = 0.012 * k;
    const double w = 2 * 3 * std::numbers::pi / 60;
    const Reference reference = {.x_m = static_cast<float>(5 * std::cos(w * t_s) - 3),
                                 .y_m = static_cast<float>(5 * std::sin(w * t_s)),
                                 .z_m = static_cast<float>(t_s / 6 + 0.5),
                                 .vx_m_s = static_cast<float>(-5 * w * std::sin(w * t_s)),
                                 .vy_m_s = static_cast<float>(5 * w * std::cos(w * t_s)),
                                 .vz_m_s = 1.0F / 6};
    ComparePeriod(law.Step(Sense(), reference), errors);
  }
  EXPECT_LT(errors.position_m, 2e-5);
  EXPECT_LT(errors.angle_rad, 5e-5);
  EXPECT_LT(errors.velocity_m_s, 2e-4);
  EXPECT_LT(errors.rate_rad_s, 2e-3);
  EXPECT_LT(errors.hinge_rate_rad_s, 2e-3);
  RecordProperty("errors",
                 ::testing::PrintToString(std::array{errors.position_m, errors.angle_rad, errors.velocity_m_s,
                                                     errors.rate_rad_s, errors.hinge_rate_rad_s}));
}

TEST_F(VehicleDynamicsTest, PredictsAVehicleWithAJammedHinge) {
  for (const unsigned held : {0U, 1U}) {
    const std::vector<double> start = {0, 0, 50, 0.2, -0.1, 1, 0.3, -0.4, 1, -2, 0.5, 0.5, 1, -1, 0, 0};
    plant_.Reset(start);
    const Actuators inputs = {.f_r_n = 12, .f_l_n = 9, .tau_r_nm = 0.01F, .tau_l_nm = -0.01F};
    std::vector<double> row;
    for (const auto& field : kActuatorFields) row.push_back(static_cast<double>(inputs.*field.in_float));
    Disturbance jam;
    jam.hinges[held].held = true;
    HeldHinges hinges{};
    hinges[held] = true;
    MotionState state = ToMotion(Sense());
    for (int step = 0; step < 3; ++step) {
      StepMotion(kTiltrotorConstants, inputs, state, hinges);
      plant_.Step(row, jam);
    }
    plant_.State(row_);
    Errors errors;
    errors.Include(ToSensors(state), row_);
    EXPECT_LT(errors.angle_rad, 2e-3) << held;
    EXPECT_LT(errors.velocity_m_s, 1e-2) << held;
    EXPECT_LT(errors.rate_rad_s, 5e-2) << held;
    EXPECT_LT(errors.hinge_rate_rad_s, 0.1) << held;
  }
}

// Far from hover, where every term of the equations counts.
TEST_F(VehicleDynamicsTest, PredictsAPeriodOfATumble) {
  Errors errors;
  for (const double sign : {-1.0, 1.0}) {
    const std::vector<double> start = {0,    0,  50,  sign * 0.4, -0.3, 2.5, 0.3, -sign * 0.4,
                                       sign, -2, 0.5, sign * 1.5, 1,    -1,  -2,  sign * 3};
    plant_.Reset(start);
    ComparePeriod({.f_r_n = 14, .f_l_n = 7, .tau_r_nm = 0.02F, .tau_l_nm = -0.01F}, errors);
  }
  EXPECT_LT(errors.position_m, 2e-4);
  EXPECT_LT(errors.angle_rad, 2e-3);
  EXPECT_LT(errors.velocity_m_s, 2e-2);
  EXPECT_LT(errors.rate_rad_s, 5e-2);
  EXPECT_LT(errors.hinge_rate_rad_s, 0.2);
  RecordProperty("errors",
                 ::testing::PrintToString(std::array{errors.position_m, errors.angle_rad, errors.velocity_m_s,
                                                     errors.rate_rad_s, errors.hinge_rate_rad_s}));
}

}  // namespace
}  // namespace tiltproof::firmware
