#include <optional>

#include "faults/fault_type.h"
#include "faults/signal_choice.h"

namespace tiltproof::faults {
namespace {

class LockedActuator : public ActuatorModel {
 public:
  explicit LockedActuator(const SignalSetup& setup) : actuator_(ActuatorIndex(setup)) {}

  void Act(std::span<double> input, const StepContext& /*context*/) override {
    if (!locked_) locked_ = input[actuator_];
    input[actuator_] = *locked_;
  }
  void Pass(std::span<const double> input, const StepContext& /*context*/) override {
    locked_ = input[actuator_];
  }

 private:
  std::size_t actuator_;
  std::optional<double> locked_;  // in force in the latest step without the fault
};

}  // namespace

FaultType ActuatorLockInPlace() {
  return {.name = "actuator.lock_in_place",
          .summary = "An actuator keeps its force or torque.",
          .semantics =
              "Models an actuator that jams, or a motor controller that stops listening. In the "
              "window, the actuator's force or torque stays what it was in the last step before, "
              "whatever is commanded. Without a step before, it stays at the first command. After a "
              "command that the trigger left out, it keeps that one. After the window, the command "
              "takes effect at once.",
          .source =
              "Ducard, Fault-tolerant Flight Control and Guidance Systems, Springer, 2009 "
              "(lock-in-place).",
          .parameters = {ActuatorParameter()},
          .kind = ActuatorKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<ActuatorModel> {
            return std::make_unique<LockedActuator>(setup);
          }}};
}

}  // namespace tiltproof::faults
