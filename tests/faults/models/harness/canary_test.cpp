#include <gtest/gtest.h>

#include "tests/faults/faulty_line.h"

namespace tiltproof::faults {
namespace {

TEST(CanaryTest, CutsBothThrustsInItsWindow) {
  FaultSpec spec = Spec("harness.canary");
  spec.start_ns = 10;
  FaultSchedule schedule = AtThePlant({spec}, 1);
  const ActuatorsTruth command{.f_r_n = 10, .f_l_n = 11, .tau_r_nm = 0.5, .tau_l_nm = 0.25};
  ActuatorsTruth input = command;
  EditActuators(schedule, 9, input);
  EXPECT_EQ(input, command);
  EditActuators(schedule, 10, input, false);
  EXPECT_EQ(input, (ActuatorsTruth{.f_r_n = 0, .f_l_n = 0, .tau_r_nm = 0.5, .tau_l_nm = 0.25}));
}

}  // namespace
}  // namespace tiltproof::faults
