#include "faults/fault_type.h"
#include "faults/signal_choice.h"

namespace tiltproof::faults {
namespace {

class OffsetActuator : public ActuatorModel {
 public:
  explicit OffsetActuator(const SignalSetup& setup)
      : actuator_(ActuatorIndex(setup)), value_(setup.parameters.Number("value")) {}

  void Act(std::span<double> input, const StepContext& /*context*/) override { input[actuator_] += value_; }

 private:
  std::size_t actuator_;
  double value_;
};

}  // namespace

FaultType ActuatorOffset() {
  return {.name = "actuator.offset",
          .summary = "An actuator delivers a constant more than commanded.",
          .semantics =
              "Models a wrong zero: a servo whose horn is set one tooth off, or a motor controller "
              "that is badly calibrated. In the window, `value` is added to the actuator's force or "
              "torque in each step. The vehicle's limits hold for the sum.",
          .source = "Isermann, Fault-Diagnosis Systems, Springer, 2006 (additive faults).",
          .parameters = {ActuatorParameter(),
                         {.name = "value",
                          .unit = "of the actuator",
                          .min = -1e6,
                          .max = 1e6,
                          .doc = "what is added",
                          .example = 0.5,
                          .zero = 0.0,
                          .severity = Scale::kLinear}},
          .kind = ActuatorKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<ActuatorModel> {
            return std::make_unique<OffsetActuator>(setup);
          }}};
}

}  // namespace tiltproof::faults
