#include <algorithm>

#include "faults/fault_type.h"
#include "faults/signal_choice.h"

namespace tiltproof::faults {
namespace {

class DeadbandActuator : public ActuatorModel {
 public:
  explicit DeadbandActuator(const SignalSetup& setup)
      : actuator_(ActuatorIndex(setup)), half_width_(setup.parameters.Number("width") / 2) {}

  void Act(std::span<double> input, const StepContext& /*context*/) override {
    double& value = input[actuator_];
    value -= std::clamp(value, -half_width_, half_width_);
  }

 private:
  std::size_t actuator_;
  double half_width_;
};

}  // namespace

FaultType ActuatorDeadband() {
  return {.name = "actuator.deadband",
          .summary = "An actuator does not react to small commands.",
          .semantics =
              "Models the friction that a motor must overcome before it moves anything. The dead band "
              "lies about 0 and is `width` wide. In the window, a command in it, with a magnitude of "
              "at most `width` / 2, gives 0. A larger one gives what exceeds the band: the command "
              "less `width` / 2 when it is positive, plus `width` / 2 when it is negative. A thrust, "
              "which is never negative, is `width` / 2 too small.",
          .source =
              "Tao and Kokotovic, Adaptive Control of Systems with Actuator and Sensor Nonlinearities, "
              "Wiley, 1996 (dead-zone).",
          .parameters = {ActuatorParameter(),
                         {.name = "width",
                          .unit = "of the actuator",
                          .min = 0.0,
                          .max = 1e6,
                          .doc = "width of the band",
                          .example = 1.0,
                          .zero = 0.0,
                          .severity = Scale::kLogarithmic}},
          .kind = ActuatorKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<ActuatorModel> {
            return std::make_unique<DeadbandActuator>(setup);
          }}};
}

}  // namespace tiltproof::faults
