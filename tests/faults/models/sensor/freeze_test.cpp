#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/faults/faulty_line.h"

namespace tiltproof::faults {
namespace {

TEST(FreezeTest, KeepsTheFirstValueOfTheWindow) {
  FaultSpec spec = Spec("sensor.freeze", {{"signal", "z_m"}});
  spec.start_ns = 2;
  spec.end_ns = 5;
  FaultSchedule schedule = AtThePlant({spec}, 1);
  std::vector<float> z;
  for (TimeNs t = 0; t < 7; ++t) {
    Sensors sensors{.x_m = static_cast<float>(t), .z_m = static_cast<float>(10 * t)};
    EditSensors(schedule, t, sensors);
    EXPECT_EQ(sensors.x_m, static_cast<float>(t));
    z.push_back(sensors.z_m);
  }
  EXPECT_THAT(z, ::testing::ElementsAre(0, 10, 20, 20, 20, 50, 60));
  EXPECT_EQ(schedule.ActivationCounts().at(0), 2);
}

}  // namespace
}  // namespace tiltproof::faults
