// Signals that faults name are looked for in the tables of the scenario's vehicle, here one of our own.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <optional>
#include <string>

#include "harness/scenario/reader.h"

namespace tiltproof::harness {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

class FaultSignalsTest : public testing::Test {
 protected:
  FaultSignalsTest()
      : models_(fs::path(testing::TempDir()) / ("tiltproof_fault_signals_" + std::to_string(getpid()))) {
    fs::create_directories(models_);
    std::ofstream(models_ / "tiltrotor.sdf") << "<sdf/>";
    options_.models_folder = models_;
    options_.vehicle_signals = [this](const Scenario&) { return signals_; };
  }
  ~FaultSignalsTest() override { fs::remove_all(models_); }

  // The reader's message about a scenario with this fault; empty if the scenario is in order.
  std::string Error(const std::string& fault) {
    try {
      ParseScenario("name: x\nduration_s: 24\nreference: {type: spiral}\nfaults: [" + fault + "]\n", "s.yaml",
                    options_);
      return "";
    } catch (const ScenarioError& error) {
      return error.what();
    }
  }
  std::string Freeze(const std::string& signal) {
    return Error("{id: a, type: sensor.freeze, parameters: {signal: " + signal + "}}");
  }
  std::string Loss(const std::string& actuator) {
    return Error("{id: a, type: actuator.loss_of_effectiveness, parameters: {actuator: " + actuator +
                 ", factor: 0.5}}");
  }

  fs::path models_;
  ReadOptions options_;
  std::optional<VehicleSignals> signals_ =
      VehicleSignals{.states = SignalTable({SignalNamed("z_m", SignalFrame::kWorld)}),
                     .sensors = SignalTable({SignalNamed("z_m", SignalFrame::kWorld),
                                             SignalNamed("keel_rad_s", SignalFrame::kHinge)}),
                     .inputs = SignalTable({SignalNamed("f_front_left_n", SignalFrame::kRotor),
                                            SignalNamed("tau_rudder_nm", SignalFrame::kHinge)}),
                     .rotors = {"front left"},
                     .joints = {"mast::rudder", "keel-joint"}};
};

TEST_F(FaultSignalsTest, SensorsGoByTheirColumn) {
  EXPECT_EQ(Freeze("keel_rad_s"), "");
  EXPECT_EQ(Freeze("z"), "s.yaml:4:60: signal: unknown value 'z'; did you mean 'z_m'?");
  EXPECT_EQ(Freeze("keel_rad"), "s.yaml:4:60: signal: unknown value 'keel_rad'; did you mean 'keel_rad_s'?");
  // An input is no sensor.
  EXPECT_EQ(Freeze("yaw_speed"),
            "s.yaml:4:60: signal: unknown value 'yaw_speed'; valid: z_m, keel_rad_s, all");
  EXPECT_EQ(Freeze("f_front_left"),
            "s.yaml:4:60: signal: unknown value 'f_front_left'; valid: z_m, keel_rad_s, all");
  EXPECT_THAT(Freeze("\"z m\""), HasSubstr("s.yaml:4:60: signal: 'z m' must be letters, digits and '_'"));
}

TEST_F(FaultSignalsTest, ActuatorsGoWithoutTheUnit) {
  EXPECT_EQ(Loss("tau_rudder"), "");
  EXPECT_THAT(Loss("f_front_rigth"),
              HasSubstr("actuator: unknown value 'f_front_rigth'; did you mean 'f_front_left'?"));
  EXPECT_THAT(Loss("x"), HasSubstr("actuator: unknown value 'x'; valid: f_front_left, tau_rudder"));
}

TEST_F(FaultSignalsTest, VectorsAndPositionsAreThoseOfTheVehicle) {
  const auto misalignment = [this](const std::string& signal) {
    return Error("{id: a, type: sensor.misalignment, parameters: {signal: " + signal +
                 ", axis: y, angle_rad: 0.1}}");
  };
  const auto spoof = [this](const std::string& signal) {
    return Error("{id: a, type: sensor.spoof, parameters: {signal: " + signal + ", rate_per_s: 0.1}}");
  };
  EXPECT_EQ(spoof("z_m"), "");
  EXPECT_EQ(spoof("x_m"), "s.yaml:4:59: signal: unknown value 'x_m'; did you mean 'z_m'?");
  EXPECT_THAT(spoof("keel_rad_s"), HasSubstr("s.yaml:4:59: signal: unknown value 'keel_rad_s'; valid: z_m"));
  EXPECT_THAT(misalignment("position"), HasSubstr("s.yaml:4:66: signal: unknown value 'position'"));
  std::vector<Signal> sensors;
  for (const char* name : {"wx_rad_s", "x_m", "wz_rad_s", "y_m", "wy_rad_s"})
    sensors.push_back(SignalNamed(name, SignalFrame::kWorld));
  signals_->sensors = SignalTable(sensors);
  EXPECT_EQ(misalignment("rates"), "");
  EXPECT_EQ(misalignment("position"), "s.yaml:4:66: signal: unknown value 'position'; valid: rates");
}

TEST_F(FaultSignalsTest, RotorsAndJointsGoByTheirNamesInTheVehiclesFile) {
  const auto jam = [this](const std::string& joint) {
    return Error("{id: a, type: plant.servo_jam, parameters: {joint: " + joint + "}}");
  };
  const auto weak = [this](const std::string& rotor) {
    return Error("{id: a, type: plant.thrust, parameters: {rotor: " + rotor + ", factor: 0.5}}");
  };
  EXPECT_EQ(jam("\"mast::rudder\""), "");
  EXPECT_EQ(jam("keel_joint"), "s.yaml:4:61: joint: unknown value 'keel_joint'; did you mean 'keel-joint'?");
  EXPECT_EQ(weak("front left"), "");
  EXPECT_THAT(weak("keel-joint"), HasSubstr("rotor: unknown value 'keel-joint'; valid: front left"));
}

// The messages carry the signals of the vehicle.
TEST_F(FaultSignalsTest, FieldsAreThoseOfTheMessagesThatPass) {
  const auto lie = [this](const std::string& field, const std::string& keys) {
    return Error("{id: a, type: frame.semantic, " + keys + ", parameters: {field: " + field +
                 ", kind: nan, probability: 1}}");
  };
  EXPECT_EQ(lie("z_m", "target: to_client"), "");
  EXPECT_EQ(lie("f_front_left_n", "target: to_plant, message: actuators"), "");
  EXPECT_EQ(lie("z", "target: to_client"), "s.yaml:4:79: field: unknown value 'z'; did you mean 'z_m'?");
  EXPECT_THAT(lie("alpha_r_rad", "target: to_plant"),
              HasSubstr("field: unknown value 'alpha_r_rad'; valid: f_front_left_n, tau_rudder_nm"));
}

TEST_F(FaultSignalsTest, WindNeedsDrag) {
  const std::string gust =
      "{id: a, type: plant.gust, parameters: {speed_m_s: 1, direction: [1, 0, 0], length_m: 9}}";
  EXPECT_EQ(Error(gust), "");
  signals_->feels_wind = false;
  EXPECT_EQ(Error(gust),
            "s.yaml:4:24: type: plant.gust moves only a vehicle with drag; this one's file has no "
            "<tiltproof:drag> (tiltrotor_drag has one)");
}

// A command of 0 would turn such a servo to 0, not free it.
TEST_F(FaultSignalsTest, AServoThatIsCommandedByAngleDoesNotFloat) {
  const auto afloat = [this](const std::string& actuator) {
    return Error("{id: a, type: actuator.float, parameters: {actuator: " + actuator + "}}");
  };
  std::vector<Signal> inputs(signals_->inputs.begin(), signals_->inputs.end());
  inputs.push_back(SignalNamed("angle_mast_rad", SignalFrame::kHinge));
  signals_->inputs = SignalTable(inputs);
  EXPECT_EQ(afloat("f_front_left"), "");
  EXPECT_EQ(afloat("tau_rudder"), "");
  EXPECT_THAT(afloat("angle_mast"),
              AllOf(HasSubstr("s.yaml:4:24: type: actuator.float needs a thrust or a torque; "
                              "'angle_mast' is a servo that is commanded by angle"),
                    HasSubstr("plant.servo_jam")));
  EXPECT_EQ(Loss("angle_mast"), "");
}

// Words that YAML takes for something else.
TEST_F(FaultSignalsTest, AChoiceIsAWordWhateverYamlMakesOfIt) {
  const auto dropout = [this](const std::string& reads) {
    return Error("{id: a, type: sensor.dropout, parameters: {signal: z_m, probability: 1, reads: " + reads +
                 "}}");
  };
  EXPECT_EQ(dropout("nan"), "");
  EXPECT_EQ(dropout("\"nan\""), "");
  EXPECT_EQ(dropout("zero"), "");
  EXPECT_THAT(dropout("inf"), HasSubstr("s.yaml:4:89: reads: expected one of last, zero, nan"));
  EXPECT_THAT(dropout("0"), HasSubstr("s.yaml:4:89: reads: expected one of last, zero, nan"));
}

TEST_F(FaultSignalsTest, AVehicleThatCannotBeLoadedIsAProblemOfTheModelAlone) {
  signals_.reset();
  EXPECT_EQ(Freeze("z"), "");
}

}  // namespace
}  // namespace tiltproof::harness
