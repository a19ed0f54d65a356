#include <gtest/gtest.h>

#include "tests/faults/faulty_line.h"

namespace tiltproof::faults {
namespace {

TEST(BiasTest, AddsToItsSignalAlone) {
  FaultSchedule schedule = AtThePlant({Spec("sensor.bias", {{"signal", "pitch_rad"}, {"offset", -0.25}})}, 1);
  Sensors sensors{.x_m = 3.0F, .pitch_rad = 0.125F};
  Sensors expected = sensors;
  expected.pitch_rad = -0.125F;
  EditSensors(schedule, 0, sensors);
  EXPECT_EQ(sensors, expected);
}

TEST(BiasTest, AnOffsetBelowTheResolutionIsNoActivation) {
  FaultSchedule schedule = AtThePlant({Spec("sensor.bias", {{"signal", "x_m"}, {"offset", 1e-9}})}, 1);
  Sensors sensors{.x_m = 100.0F};
  EditSensors(schedule, 0, sensors);
  EXPECT_EQ(sensors.x_m, 100.0F);
  EXPECT_EQ(schedule.ActivationCounts().at(0), 0);
}

}  // namespace
}  // namespace tiltproof::faults
