#include <gtest/gtest.h>

#include <stdexcept>
#include <string>

#include "tests/faults/one_signal.h"

namespace tiltproof::faults {
namespace {

FaultSpec HardOver(const std::string& actuator, const std::string& side) {
  return Spec("actuator.hard_over", {{"actuator", actuator}, {"side", side}});
}

TEST(HardOverTest, GoesToTheLimitsOfTheVehiclesTable) {
  const auto edited = [](const std::string& actuator, const std::string& side) {
    FaultSchedule schedule = AtThePlant({HardOver(actuator, side)});
    ActuatorsTruth input{.f_r_n = 8, .f_l_n = 6, .tau_r_nm = 0.5, .tau_l_nm = -0.5};
    EditActuators(schedule, 0, input);
    return input;
  };
  EXPECT_EQ(edited("f_r", "max"),
            (ActuatorsTruth{.f_r_n = 30, .f_l_n = 6, .tau_r_nm = 0.5, .tau_l_nm = -0.5}));
  EXPECT_EQ(edited("f_l", "min"),
            (ActuatorsTruth{.f_r_n = 8, .f_l_n = 0, .tau_r_nm = 0.5, .tau_l_nm = -0.5}));
  EXPECT_EQ(edited("tau_r", "min"),
            (ActuatorsTruth{.f_r_n = 8, .f_l_n = 6, .tau_r_nm = -2, .tau_l_nm = -0.5}));
  EXPECT_EQ(edited("tau_l", "max"), (ActuatorsTruth{.f_r_n = 8, .f_l_n = 6, .tau_r_nm = 0.5, .tau_l_nm = 2}));
}

TEST(HardOverTest, AnInputWithoutALimitIsRefused) {
  VehicleSignals signals = TiltrotorSignals();
  signals.inputs = SignalTable({SignalNamed("f_r_n", SignalFrame::kRotor)});
  EXPECT_THROW(AtTheLine({HardOver("f_r", "max")}, 1, {.signals = signals}), std::invalid_argument);
}

}  // namespace
}  // namespace tiltproof::faults
