#include "faults/fault_type.h"
#include "faults/signal_choice.h"

namespace tiltproof::faults {
namespace {

class LossOfEffectiveness : public ActuatorModel {
 public:
  explicit LossOfEffectiveness(const SignalSetup& setup)
      : actuator_(ActuatorIndex(setup)), factor_(setup.parameters.Number("factor")) {}

  void Act(std::span<double> input, const StepContext& /*context*/) override { input[actuator_] *= factor_; }

 private:
  std::size_t actuator_;
  double factor_;
};

}  // namespace

FaultType ActuatorLossOfEffectiveness() {
  return {.name = "actuator.loss_of_effectiveness",
          .summary = "An actuator delivers only a part of what is commanded.",
          .semantics =
              "Models a nicked blade, a weak motor or a low supply. The actuator's force or torque is "
              "`factor` times the command: 1 is a healthy actuator, 0 a "
              "dead one. This holds throughout the window, also for a command that was given before it.",
          .source =
              "Ducard, Fault-tolerant Flight Control and Guidance Systems, Springer, 2009 (loss of "
              "effectiveness).",
          .parameters = {ActuatorParameter(),
                         {.name = "factor",
                          .unit = "1",
                          .min = 0.0,
                          .max = 1.0,
                          .doc = "what remains of the command; 1 changes nothing",
                          .example = 0.7,
                          .zero = 1.0,
                          .severity = Scale::kLinear}},
          .kind = ActuatorKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<ActuatorModel> {
            return std::make_unique<LossOfEffectiveness>(setup);
          }}};
}

}  // namespace tiltproof::faults
