#include "faults/fault_type.h"
#include "faults/signal_choice.h"

namespace tiltproof::faults {
namespace {

class NoisyActuator : public ActuatorModel {
 public:
  explicit NoisyActuator(const SignalSetup& setup)
      : actuator_(ActuatorIndex(setup)), std_(setup.parameters.Number("std")) {}

  void Act(std::span<double> input, const StepContext& context) override {
    input[actuator_] += std_ * context.random.StandardNormal();
  }

 private:
  std::size_t actuator_;
  double std_;
};

}  // namespace

FaultType ActuatorNoise() {
  return {.name = "actuator.noise",
          .summary = "An actuator delivers its command with white noise.",
          .semantics =
              "Models a motor that runs roughly: a worn brush, a bad bearing, a disturbed supply. In "
              "each step of the window, a random value is added to the actuator's force or torque. It "
              "is normally distributed, with mean 0 and standard deviation `std`, and independent of "
              "the values in other steps. It holds for the step: shorter steps spread the same `std` "
              "over a wider band, with less effect on the vehicle. The vehicle's limits hold for the "
              "sum.",
          .source = "Isermann, Fault-Diagnosis Systems, Springer, 2006.",
          .parameters = {ActuatorParameter(),
                         {.name = "std",
                          .unit = "of the actuator",
                          .min = 0.0,
                          .max = 1e6,
                          .doc = "standard deviation",
                          .example = 0.5,
                          .zero = 0.0,
                          .severity = Scale::kLogarithmic}},
          .kind = ActuatorKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<ActuatorModel> {
            return std::make_unique<NoisyActuator>(setup);
          }}};
}

}  // namespace tiltproof::faults
