#include "faults/model.h"

namespace tiltproof::faults {
namespace {

class Canary : public ActuatorModel {
 public:
  void Act(ActuatorsTruth& actuators) const override {
    actuators.f_r_n = 0.0;
    actuators.f_l_n = 0.0;
  }
};

}  // namespace

FaultType HarnessCanary() {
  return {.name = "harness.canary",
          .stage = Stage::kActuator,
          .summary = "Cuts both thrusts: no flight may survive it.",
          .semantics =
              "Both thrusts are 0 throughout the window, whatever is commanded. A verdict other "
              "than fail shows that faults or scoring do not work.",
          .make_actuator = [](const Parameters&) -> std::unique_ptr<ActuatorModel> {
            return std::make_unique<Canary>();
          }};
}

}  // namespace tiltproof::faults
