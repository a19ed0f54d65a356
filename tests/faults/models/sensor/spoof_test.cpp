#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>
#include <vector>

#include "tests/faults/faulty_line.h"

namespace tiltproof::faults {
namespace {

// The velocity that is read is the rate at which the position that is read changes.
TEST(SpoofTest, PositionAndVelocityFitEachOther) {
  FaultSpec spec =
      At(Spec("sensor.spoof", {{"signal", "y_m"}, {"rate_per_s", 0.4}}), 5 * kPeriod, 300 * kPeriod);
  FaultSchedule schedule = AtThePlant({spec}, 1);
  double before = 0;
  for (std::int64_t n = 0; n < 310; ++n) {
    Sensors sensors{.x_m = 8};
    EditSensors(schedule, n * kPeriod, sensors);
    const auto error = static_cast<double>(sensors.y_m);
    if (n < 5 || n >= 300) {
      EXPECT_EQ(sensors, Sensors{.x_m = 8}) << n;
    } else {
      EXPECT_EQ(sensors, (Sensors{.x_m = 8, .y_m = sensors.y_m, .vy_m_s = 0.4F})) << n;
      EXPECT_NEAR(error, 0.4 * 0.012 * static_cast<double>(n - 5), 1e-6) << n;
      if (n > 5) {
        EXPECT_NEAR((error - before) / 0.012, static_cast<double>(sensors.vy_m_s), 1e-4) << n;
      }
    }
    before = error;
  }
}

TEST(SpoofTest, BeginsAnewInEachPeriod) {
  FaultSpec spec = At(Spec("sensor.spoof", {{"signal", "z_m"}, {"rate_per_s", 1000.0}}), 0);
  spec.period_ns = 4 * kPeriod;
  spec.duty = 0.75;
  FaultSchedule schedule = AtThePlant({spec}, 1);
  std::vector<float> heights;
  for (std::int64_t n = 0; n < 8; ++n) {
    Sensors sensors;
    EditSensors(schedule, n * kPeriod, sensors);
    heights.push_back(sensors.z_m);
  }
  EXPECT_THAT(heights, ::testing::ElementsAre(0, 12, 24, 0, 0, 12, 24, 0));
}

TEST(SpoofTest, PullsPositionsAlone) {
  EXPECT_THROW(AtThePlant({Spec("sensor.spoof", {{"signal", "roll_rad"}, {"rate_per_s", 1.0}})}),
               std::invalid_argument);
}

TEST(SpoofTest, AVehicleMayHaveNoVelocity) {
  VehicleSignals signals = TiltrotorSignals();
  signals.sensors = SignalTable({SignalNamed("x_m", SignalFrame::kWorld)});
  FaultSchedule schedule =
      AtTheLine({Spec("sensor.spoof", {{"signal", "x_m"}, {"rate_per_s", 1000.0}})}, 1, {.signals = signals});
  std::vector<double> row = {5};
  schedule.EditSensors(0, row, BootTime());
  schedule.EditSensors(kPeriod, row, BootTime());
  EXPECT_EQ(row.front(), 17);
}

}  // namespace
}  // namespace tiltproof::faults
