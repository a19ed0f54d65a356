#include <gtest/gtest.h>

#include "tests/faults/faulty_line.h"

namespace tiltproof::faults {
namespace {

TEST(LossOfEffectivenessTest, ScalesItsActuatorAlone) {
  const ActuatorsTruth command{.f_r_n = 8, .f_l_n = 6, .tau_r_nm = 0.5, .tau_l_nm = -0.5};
  const auto edited = [&command](const std::string& actuator, double factor) {
    FaultSchedule schedule =
        AtThePlant({Spec("actuator.loss_of_effectiveness", {{"actuator", actuator}, {"factor", factor}})}, 1);
    ActuatorsTruth input = command;
    EditActuators(schedule, 0, input);
    return input;
  };
  EXPECT_EQ(edited("f_r", 0.25), (ActuatorsTruth{.f_r_n = 2, .f_l_n = 6, .tau_r_nm = 0.5, .tau_l_nm = -0.5}));
  EXPECT_EQ(edited("f_l", 0.5), (ActuatorsTruth{.f_r_n = 8, .f_l_n = 3, .tau_r_nm = 0.5, .tau_l_nm = -0.5}));
  EXPECT_EQ(edited("tau_r", 0.0), (ActuatorsTruth{.f_r_n = 8, .f_l_n = 6, .tau_r_nm = 0, .tau_l_nm = -0.5}));
  EXPECT_EQ(edited("tau_l", 0.5),
            (ActuatorsTruth{.f_r_n = 8, .f_l_n = 6, .tau_r_nm = 0.5, .tau_l_nm = -0.25}));
  EXPECT_EQ(edited("tau_l", 1.0), command);
}

}  // namespace
}  // namespace tiltproof::faults
