#include <algorithm>
#include <optional>

#include "faults/fault_type.h"
#include "faults/signal_choice.h"

namespace tiltproof::faults {
namespace {

class RateLimit : public ActuatorModel {
 public:
  explicit RateLimit(const SignalSetup& setup)
      : actuator_(ActuatorIndex(setup)), rate_per_s_(setup.parameters.Number("rate_per_s")) {}

  void Act(std::span<double> input, const StepContext& context) override {
    double& value = input[actuator_];
    const double step = rate_per_s_ * ToSeconds(context.step_ns);
    if (last_) value = std::clamp(value, *last_ - step, *last_ + step);
    last_ = value;
  }
  void Pass(std::span<const double> input, const StepContext& /*context*/) override {
    last_ = input[actuator_];
  }

 private:
  std::size_t actuator_;
  double rate_per_s_;
  std::optional<double> last_;  // in force in the step before
};

}  // namespace

FaultType ActuatorRateLimit() {
  return {.name = "actuator.rate_limit",
          .summary = "An actuator follows its commands only at a limited rate.",
          .semantics =
              "Models a motor that is too weak to accelerate its rotor as fast as commanded. In the window, "
              "the actuator's force or torque changes in each step of the plant by no more "
              "than `rate_per_s` times the length of the step. It begins with the value that was in force "
              "before the window, and moves towards the latest command until it reaches it. After the "
              "window, the command takes effect at once.",
          .source =
              "Stevens, Lewis and Johnson, Aircraft Control and Simulation, 3rd ed., Wiley, 2016 (rate "
              "limits of actuators).",
          .parameters = {ActuatorParameter(),
                         {.name = "rate_per_s",
                          .unit = "of the actuator, 1/s",
                          .min = 0.0,
                          .max = 1e6,
                          .doc = "the fastest change, in the actuator's unit per second",
                          .example = 0.5,
                          .zero = 1e6,
                          .severity = Scale::kLogarithmic}},
          .kind = ActuatorKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<ActuatorModel> {
            return std::make_unique<RateLimit>(setup);
          }}};
}

}  // namespace tiltproof::faults
