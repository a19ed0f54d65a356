#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/faults/faulty_line.h"

namespace tiltproof::faults {
namespace {

FaultSpec Limit(double rate_per_s) {
  return Spec("actuator.rate_limit", {{"actuator", "f_r"}, {"rate_per_s", rate_per_s}});
}

// 250 N/s are 1 N in each step of 4 ms.
TEST(RateLimitTest, GoesOnFromWhatWasInForceUntilTheCommandIsReached) {
  FaultSpec spec = Limit(250);
  spec.start_ns = 8 * kNsPerMs;
  spec.end_ns = 32 * kNsPerMs;
  FaultSchedule schedule = AtThePlant({spec});
  std::vector<double> thrusts;
  for (int step = 0; step < 10; ++step) {
    // Commands at steps 0, 3 and 6; the last holds.
    ActuatorsTruth input{.f_r_n = step < 3 ? 10.0 : step < 6 ? 12.5 : 4.0, .f_l_n = 7.0 + step};
    EditActuators(schedule, step * 4 * kNsPerMs, input, step % 3 == 0 && step < 7);
    thrusts.push_back(input.f_r_n);
    EXPECT_EQ(input.f_l_n, 7.0 + step);
  }
  EXPECT_THAT(thrusts, ::testing::ElementsAre(10, 10, 10, 11, 12, 12.5, 11.5, 10.5, 4, 4));
  EXPECT_THAT(schedule.ActivationCounts(), ::testing::ElementsAre(2));
}

TEST(RateLimitTest, AtZeroItStays) {
  FaultSpec spec = Limit(0);
  spec.start_ns = 4 * kNsPerMs;
  FaultSchedule schedule = AtThePlant({spec});
  for (int step = 0; step < 5; ++step) {
    ActuatorsTruth input{.f_r_n = 10.0 + step};
    EditActuators(schedule, step * 4 * kNsPerMs, input);
    EXPECT_EQ(input.f_r_n, 10);
  }
}

}  // namespace
}  // namespace tiltproof::faults
