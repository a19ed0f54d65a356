#include <cmath>
#include <optional>

#include "faults/fault_type.h"
#include "faults/signal_choice.h"

namespace tiltproof::faults {
namespace {

class LaggingActuator : public ActuatorModel {
 public:
  explicit LaggingActuator(const SignalSetup& setup)
      : actuator_(ActuatorIndex(setup)), time_constant_s_(setup.parameters.Number("time_constant_s")) {}

  void Act(std::span<double> input, const StepContext& context) override {
    double& value = input[actuator_];
    if (last_ && time_constant_s_ > 0)
      value = *last_ - std::expm1(-ToSeconds(context.step_ns) / time_constant_s_) * (value - *last_);
    last_ = value;
  }
  void Pass(std::span<const double> input, const StepContext& /*context*/) override {
    last_ = input[actuator_];
  }

 private:
  std::size_t actuator_;
  double time_constant_s_;
  std::optional<double> last_;  // in force in the step before
};

}  // namespace

FaultType ActuatorLag() {
  return {.name = "actuator.lag",
          .summary = "An actuator follows its commands slowly.",
          .semantics =
              "Models the inertia of a rotor or the inductance of a motor: a first-order lag. In each step "
              "of the window, of length dt, the actuator's distance from the command shrinks by the factor "
              "exp(-dt / `time_constant_s`), and the result holds for this step. After a step of the "
              "command, 63 % of the way are covered within `time_constant_s`. It begins with the value that "
              "was in force before the window. Without a step before, it begins with the first command. "
              "After the window, the command takes effect at once. A `time_constant_s` of 0 changes nothing.",
          .source =
              "Stevens, Lewis and Johnson, Aircraft Control and Simulation, 3rd ed., Wiley, 2016 "
              "(first-order actuator).",
          .parameters = {ActuatorParameter(),
                         {.name = "time_constant_s",
                          .unit = "s",
                          .min = 0.0,
                          .max = 1000.0,
                          .doc = "time in which 63 % of a step are covered",
                          .example = 0.1,
                          .zero = 0.0,
                          .severity = Scale::kLogarithmic}},
          .kind = ActuatorKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<ActuatorModel> {
            return std::make_unique<LaggingActuator>(setup);
          }}};
}

}  // namespace tiltproof::faults
