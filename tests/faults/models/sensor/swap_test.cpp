#include <gtest/gtest.h>

#include "tests/faults/faulty_line.h"

namespace tiltproof::faults {
namespace {

TEST(SwapTest, ExchangesTwoSensors) {
  FaultSchedule schedule = AtThePlant({Spec("sensor.swap", {{"signal", "vx_m_s"}, {"with", "wz_rad_s"}})}, 1);
  Sensors sensors{.z_m = 1, .vx_m_s = 2, .wz_rad_s = 3};
  EditSensors(schedule, 0, sensors);
  EXPECT_EQ(sensors, (Sensors{.z_m = 1, .vx_m_s = 3, .wz_rad_s = 2}));
  EXPECT_EQ(schedule.ActivationCounts().at(0), 1);
}

TEST(SwapTest, OfASensorWithItselfChangesNothing) {
  FaultSchedule schedule = AtThePlant({Spec("sensor.swap", {{"signal", "z_m"}, {"with", "z_m"}})}, 1);
  Sensors sensors{.z_m = 1};
  EditSensors(schedule, 0, sensors);
  EXPECT_EQ(sensors, Sensors{.z_m = 1});
  EXPECT_EQ(schedule.ActivationCounts().at(0), 0);
}

}  // namespace
}  // namespace tiltproof::faults
