#include <algorithm>
#include <optional>

#include "faults/fault_type.h"
#include "faults/signal_choice.h"

namespace tiltproof::faults {
namespace {

class LooseActuator : public ActuatorModel {
 public:
  explicit LooseActuator(const SignalSetup& setup)
      : actuator_(ActuatorIndex(setup)), half_width_(setup.parameters.Number("width") / 2) {}

  void Act(std::span<double> input, const StepContext& /*context*/) override {
    double& value = input[actuator_];
    if (last_) value = std::clamp(*last_, value - half_width_, value + half_width_);
    last_ = value;
  }
  void Pass(std::span<const double> input, const StepContext& /*context*/) override {
    last_ = input[actuator_];
  }

 private:
  std::size_t actuator_;
  double half_width_;
  std::optional<double> last_;  // in force in the step before
};

}  // namespace

FaultType ActuatorBacklash() {
  return {.name = "actuator.backlash",
          .summary = "An actuator follows a reversed command only after some play.",
          .semantics =
              "Models worn gears: after a reversal the command must cross the gap before the output follows. "
              "This is the play operator. In each step of the window, the actuator's force or torque keeps "
              "its value of the step before, as long as that is within `width` / 2 of the command. Otherwise "
              "it becomes the command less `width` / 2 when the command is above it, plus `width` / 2 when "
              "it is below. It begins with the value that was in force before the window. Without a step "
              "before, it begins with the first command. After the window, the command takes effect at once.",
          .source =
              "Tao and Kokotovic, Adaptive Control of Systems with Actuator and Sensor Nonlinearities, "
              "Wiley, 1996 (backlash).",
          .parameters = {ActuatorParameter(),
                         {.name = "width",
                          .unit = "of the actuator",
                          .min = 0.0,
                          .max = 1e6,
                          .doc = "the whole play",
                          .example = 0.5,
                          .zero = 0.0,
                          .severity = Scale::kLogarithmic}},
          .kind = ActuatorKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<ActuatorModel> {
            return std::make_unique<LooseActuator>(setup);
          }}};
}

}  // namespace tiltproof::faults
