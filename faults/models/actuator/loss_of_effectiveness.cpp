#include "faults/model.h"
#include "faults/signal_choice.h"

namespace tiltproof::faults {
namespace {

class LossOfEffectiveness : public ActuatorModel {
 public:
  explicit LossOfEffectiveness(const Parameters& parameters)
      : actuator_(ActuatorNamed(parameters.Choice("actuator"))), factor_(parameters.Number("factor")) {}

  void Act(ActuatorsTruth& actuators) const override { actuators.*actuator_ *= factor_; }

 private:
  double ActuatorsTruth::*actuator_;
  double factor_;
};

}  // namespace

FaultType ActuatorLossOfEffectiveness() {
  return {.name = "actuator.loss_of_effectiveness",
          .stage = Stage::kActuator,
          .summary = "An actuator yields only a part of what is commanded.",
          .semantics =
              "The actuator's force or torque is `factor` times the command: 1 is a healthy "
              "actuator, 0 a dead one. In force throughout the window, also on a command that was "
              "given before it.",
          .parameters = {ActuatorParameter(),
                         {.name = "factor",
                          .unit = "1",
                          .min = 0.0,
                          .max = 1.0,
                          .doc = "what remains of the command; 1 changes nothing",
                          .example = 0.7,
                          .zero = 1.0}},
          .make_actuator = [](const Parameters& parameters) -> std::unique_ptr<ActuatorModel> {
            return std::make_unique<LossOfEffectiveness>(parameters);
          }};
}

}  // namespace tiltproof::faults
