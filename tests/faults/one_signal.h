// Effects of a fault on one sensor or one actuator, over a flight without a vehicle.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "tests/faults/faulty_line.h"

namespace tiltproof::faults {

inline constexpr TimeNs kStep = 4 * kNsPerMs;

// The heights (z_m) that are read when sample n, at n * 12 ms, has the true value truth(n). Checks that no
// other sensor changes.
inline std::vector<float> ReadHeights(const FaultSpec& spec, std::int64_t count,
                                      const std::function<float(std::int64_t)>& truth,
                                      std::uint64_t seed = 1) {
  FaultSchedule schedule = AtThePlant({spec}, seed);
  std::vector<float> heights;
  for (std::int64_t n = 0; n < count; ++n) {
    Sensors sensors{.x_m = 1.0F, .vz_m_s = 2.0F};
    sensors.z_m = truth(n);
    Sensors others = sensors;
    EditSensors(schedule, n * kPeriod, sensors);
    heights.push_back(sensors.z_m);
    others.z_m = sensors.z_m = 0;
    EXPECT_EQ(sensors, others) << n;
  }
  return heights;
}

// The right thrusts (f_r) in force when the command in step n, at n * 4 ms, is command(n). Each step has a
// command of its own. Checks that no other actuator changes.
inline std::vector<double> RightThrusts(const FaultSpec& spec, std::int64_t count,
                                        const std::function<double(std::int64_t)>& command,
                                        std::uint64_t seed = 1) {
  FaultSchedule schedule = AtThePlant({spec}, seed);
  std::vector<double> thrusts;
  for (std::int64_t n = 0; n < count; ++n) {
    ActuatorsTruth input{.f_r_n = command(n), .f_l_n = 7, .tau_r_nm = 0.5, .tau_l_nm = -0.5};
    ActuatorsTruth others = input;
    EditActuators(schedule, n * kStep, input);
    thrusts.push_back(input.f_r_n);
    others.f_r_n = input.f_r_n;
    EXPECT_EQ(input, others) << n;
  }
  return thrusts;
}

}  // namespace tiltproof::faults
