#include <gtest/gtest.h>

#include "tests/faults/faulty_line.h"

namespace tiltproof::faults {
namespace {

TEST(NullTest, CountsEverySampleAndChangesNone) {
  FaultSchedule schedule = AtThePlant({Spec("harness.null")}, 1);
  for (TimeNs t = 0; t < 5; ++t) {
    Sensors sensors{.x_m = 1.0F};
    const Sensors before = sensors;
    EditSensors(schedule, t, sensors);
    EXPECT_EQ(sensors, before);
  }
  EXPECT_EQ(schedule.ActivationCounts().at(0), 5);
  EXPECT_EQ(schedule.TakeActivations(kOriginAtPowerOn).at(0).what, "nothing changed");
}

}  // namespace
}  // namespace tiltproof::faults
