#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <array>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "faults/signal_choice.h"
#include "tests/faults/faulty_line.h"

namespace tiltproof::faults {
namespace {

// Against Eigen: a vector along axes that are turned by R has the components R^T v.
TEST(MisalignmentTest, IsARotationOfTheAxes) {
  const Eigen::Vector3d v(0.3, -1.7, 2.9);
  for (const auto& [axis, direction] :
       std::vector<std::pair<std::string, Eigen::Vector3d>>{{"x", Eigen::Vector3d::UnitX()},
                                                            {"y", Eigen::Vector3d::UnitY()},
                                                            {"z", Eigen::Vector3d::UnitZ()}}) {
    for (const double angle : {-3.0, -0.1, 0.02, 1.0, 2.5}) {
      const Eigen::Vector3d expected =
          Eigen::AngleAxisd(angle, direction).toRotationMatrix().transpose() * v.cast<float>().cast<double>();
      for (const std::string signal : {"position", "velocity", "rates"}) {
        FaultSchedule schedule = AtThePlant(
            {Spec("sensor.misalignment", {{"signal", signal}, {"axis", axis}, {"angle_rad", angle}})}, 1);
        Sensors sensors{.roll_rad = 0.4F};
        const auto vector = [&]() -> std::array<float*, 3> {
          if (signal == "position") return {&sensors.x_m, &sensors.y_m, &sensors.z_m};
          if (signal == "velocity") return {&sensors.vx_m_s, &sensors.vy_m_s, &sensors.vz_m_s};
          return {&sensors.wx_rad_s, &sensors.wy_rad_s, &sensors.wz_rad_s};
        }();
        for (std::size_t i = 0; i < 3; ++i)
          *vector.at(i) = static_cast<float>(v[static_cast<Eigen::Index>(i)]);
        EditSensors(schedule, 0, sensors);
        for (std::size_t i = 0; i < 3; ++i) {
          EXPECT_NEAR(*vector.at(i), expected[static_cast<Eigen::Index>(i)], 3e-7)
              << signal << " " << axis << " " << angle << " " << i;
          *vector.at(i) = 0;
        }
        EXPECT_EQ(sensors, Sensors{.roll_rad = 0.4F});
      }
    }
  }
}

TEST(MisalignmentTest, NeedsAllThreeSensors) {
  VehicleSignals signals = TiltrotorSignals();
  std::vector<Signal> some;
  for (const Signal& signal : signals.sensors)
    if (signal.name != "vy_m_s") some.push_back(signal);
  signals.sensors = SignalTable(some);
  EXPECT_THAT(SignalNames(signals, ParameterKind::kSensorVector),
              ::testing::ElementsAre("position", "rates"));
  const FaultSpec spec =
      Spec("sensor.misalignment", {{"signal", "velocity"}, {"axis", "x"}, {"angle_rad", 0.1}});
  EXPECT_THROW(AtTheLine({spec}, 1, {.signals = signals}), std::invalid_argument);
}

}  // namespace
}  // namespace tiltproof::faults
