#include <cmath>
#include <stdexcept>

#include "faults/fault_type.h"
#include "faults/signal_choice.h"
#include "faults/text.h"

namespace tiltproof::faults {
namespace {

class HardOverActuator : public ActuatorModel {
 public:
  explicit HardOverActuator(const SignalSetup& setup)
      : actuator_(ActuatorIndex(setup)), limit_(LimitOf(setup, setup.signals.inputs[actuator_])) {}

  void Act(std::span<double> input, const StepContext& /*context*/) override { input[actuator_] = limit_; }

 private:
  static double LimitOf(const SignalSetup& setup, const Signal& input) {
    const double limit = setup.parameters.Choice("side") == "min" ? input.min : input.max;
    if (!std::isfinite(limit))
      throw std::invalid_argument(Concat({"the vehicle's input '", input.name, "' has no limit there"}));
    return limit;
  }

  std::size_t actuator_;
  double limit_;
};

}  // namespace

FaultType ActuatorHardOver() {
  return {.name = "actuator.hard_over",
          .summary = "An actuator goes to its limit.",
          .semantics =
              "Models a runaway: a motor controller or servo that drives to one end by itself. In the "
              "window, the actuator's force, torque or angle is the smallest (`min`) or the largest (`max`) "
              "that the vehicle's file allows, whatever is commanded. For the tilt-rotor these are 0 "
              "and 30 N of thrust, and -2 and 2 N m of servo torque.",
          .source = "Ducard, Fault-tolerant Flight Control and Guidance Systems, Springer, 2009 (hard-over).",
          .parameters = {ActuatorParameter(),
                         {.name = "side",
                          .unit = "",
                          .kind = ParameterKind::kChoice,
                          .doc = "the limit to which it goes",
                          .example = "max",
                          .choices = {"min", "max"}}},
          .kind = ActuatorKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<ActuatorModel> {
            return std::make_unique<HardOverActuator>(setup);
          }}};
}

}  // namespace tiltproof::faults
