#include <cmath>

#include "faults/active_time.h"
#include "faults/fault_type.h"
#include "faults/signal_choice.h"

namespace tiltproof::faults {
namespace {

class OscillatingActuator : public ActuatorModel {
 public:
  explicit OscillatingActuator(const SignalSetup& setup)
      : actuator_(ActuatorIndex(setup)),
        amplitude_(setup.parameters.Number("amplitude")),
        frequency_hz_(setup.parameters.Number("frequency_hz")) {}

  void Act(std::span<double> input, const StepContext& context) override {
    constexpr double kTurn_rad = 6.283185307179586;
    const double turns = frequency_hz_ * ToSeconds(time_.At(context).value_or(0));
    input[actuator_] += amplitude_ * std::sin(kTurn_rad * (turns - std::floor(turns)));
  }
  void Pass(std::span<const double> /*input*/, const StepContext& context) override { time_.At(context); }

 private:
  std::size_t actuator_;
  double amplitude_, frequency_hz_;
  ActiveTime time_;
};

}  // namespace

FaultType ActuatorOscillation() {
  return {.name = "actuator.oscillation",
          .summary = "An actuator swings about its command.",
          .semantics =
              "Models an oscillatory failure: a servo loop or a sensor in it that makes the output swing. In "
              "each step of the window, `amplitude` times sin(2 pi `frequency_hz` t) is added to the "
              "actuator's force or torque. The time t counts from the begin of the first step in the window "
              "to the begin of this step. The value holds for the step, so frequencies above half the rate "
              "of the plant's steps appear as lower ones. The swing begins again at 0 after each step "
              "outside the fault's active time, so in each period of an intermittent fault, and each time "
              "that a condition holds again. The vehicle's limits hold for the sum.",
          .source =
              "Goupil, Oscillatory Failure Case Detection in the A380 Electrical Flight Control System by "
              "Analytical Redundancy, Control Engineering Practice 18(9), 2010.",
          .parameters = {ActuatorParameter(),
                         {.name = "amplitude",
                          .unit = "of the actuator",
                          .min = 0.0,
                          .max = 1e6,
                          .doc = "the greatest deviation",
                          .example = 1.0,
                          .zero = 0.0,
                          .severity = Scale::kLogarithmic},
                         {.name = "frequency_hz",
                          .unit = "Hz",
                          .min = 0.0,
                          .max = 1000.0,
                          .doc = "swings per second",
                          .example = 3.0}},
          .kind = ActuatorKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<ActuatorModel> {
            return std::make_unique<OscillatingActuator>(setup);
          }}};
}

}  // namespace tiltproof::faults
