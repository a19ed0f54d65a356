// Faults on the sensors of a vehicle's file: by name, by group and as a vector, in full precision.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "faults/signal_choice.h"
#include "tests/faults/faulty_line.h"

namespace tiltproof::faults {
namespace {

using ::testing::ElementsAre;

// One state, and what two sensors read.
VehicleSignals MeasuredSignals() {
  std::vector<Signal> measured;
  for (const char* name : {"acc_x_m_s2", "acc_y_m_s2", "acc_z_m_s2", "gnss_lat_deg"}) {
    measured.push_back(SignalNamed(name, SignalFrame::kBody));
    measured.back().group = measured.back().name.substr(0, measured.back().name.find('_'));
  }
  std::vector<Signal> all = {SignalNamed("z_m", SignalFrame::kWorld)};
  all.insert(all.end(), measured.begin(), measured.end());
  return {.states = SignalTable({all.front()}),
          .sensors = SignalTable(all),
          .inputs = {},
          .measured = SignalTable(measured)};
}

std::vector<double> Edited(const FaultSpec& spec, std::vector<double> row) {
  const VehicleSignals signals = MeasuredSignals();
  FaultSchedule schedule = AtTheLine({spec}, 1, {.signals = signals});
  schedule.EditSensors(0, row);
  return row;
}

constexpr double kFine = 47.3977421234567;  // more digits than 32 bits have

TEST(MeasuredSignals, KeepTheirDigitsWhereStatesAreRoundedToTheLine) {
  const std::vector<double> row =
      Edited(Spec("sensor.bias", {{"signal", "gnss_lat_deg"}, {"offset", 1e-6}}), {0.1, 1, 2, 3, kFine});
  EXPECT_EQ(row[0], static_cast<double>(0.1F));
  EXPECT_EQ(row[4], kFine + 1e-6);
}

TEST(MeasuredSignals, AGroupIsEachOfItsSensors) {
  EXPECT_THAT(SignalNames(MeasuredSignals(), ParameterKind::kSensorOrAll),
              ElementsAre("z_m", "acc_x_m_s2", "acc_y_m_s2", "acc_z_m_s2", "gnss_lat_deg", "acc", "all"));
  EXPECT_THAT(Edited(Spec("sensor.scale", {{"signal", "acc"}, {"factor", 2.0}}), {1, 1, 2, 3, kFine}),
              ElementsAre(1, 2, 4, 6, kFine));
  EXPECT_THAT(Edited(Spec("sensor.scale", {{"signal", "all"}, {"factor", 2.0}}), {1, 1, 2, 3, kFine}),
              ElementsAre(2, 2, 4, 6, 2 * kFine));
}

TEST(MeasuredSignals, AGroupDrawsForEachSensorAsAFaultOnItAloneWould) {
  const std::vector<double> group =
      Edited(Spec("sensor.noise", {{"signal", "acc"}, {"std", 1.0}}), {0, 0, 0, 0, 0});
  const std::vector<double> all =
      Edited(Spec("sensor.noise", {{"signal", "all"}, {"std", 1.0}}), {0, 0, 0, 0, 0});
  EXPECT_NE(group[1], group[2]);
  EXPECT_NE(group[1], 0);
  EXPECT_EQ(group[0], 0);
  EXPECT_EQ(std::vector(group.begin() + 1, group.begin() + 4), std::vector(all.begin() + 1, all.begin() + 4));
}

TEST(MeasuredSignals, AGroupOfThreeIsAVector) {
  EXPECT_THAT(SignalNames(MeasuredSignals(), ParameterKind::kSensorVector), ElementsAre("acc"));
  const std::vector<double> row = Edited(
      Spec("sensor.misalignment", {{"signal", "acc"}, {"axis", "z"}, {"angle_rad", 0.5}}), {1, 2, 3, 4, 5});
  EXPECT_DOUBLE_EQ(row[1], 2 * std::cos(0.5) + 3 * std::sin(0.5));
  EXPECT_DOUBLE_EQ(row[2], 3 * std::cos(0.5) - 2 * std::sin(0.5));
  EXPECT_EQ(row[3], 4);
}

TEST(MeasuredSignals, AVehicleWithoutThemHasNoGroups) {
  EXPECT_TRUE(SensorsNamedBy(TiltrotorSignals(), "acc").empty());
  EXPECT_THROW(AtThePlant({Spec("sensor.noise", {{"signal", "acc"}, {"std", 1.0}})}), std::invalid_argument);
}

}  // namespace
}  // namespace tiltproof::faults
