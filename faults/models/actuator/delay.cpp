#include "faults/delay_line.h"
#include "faults/fault_type.h"
#include "faults/signal_choice.h"

namespace tiltproof::faults {
namespace {

class LateActuator : public ActuatorModel {
 public:
  explicit LateActuator(const SignalSetup& setup)
      : actuator_(ActuatorIndex(setup)), past_(FromSeconds(setup.parameters.Number("delay_ms") * 1e-3)) {}

  void Act(std::span<double> input, const StepContext& context) override {
    Push(input, context);
    input[actuator_] = past_.Delayed();
  }
  void Pass(std::span<const double> input, const StepContext& context) override { Push(input, context); }

 private:
  void Push(std::span<const double> input, const StepContext& context) {
    past_.Push(now_ns_ += context.step_ns, input[actuator_]);
  }

  std::size_t actuator_;
  DelayLine<double> past_;
  TimeNs now_ns_ = 0;  // since the first step
};

}  // namespace

FaultType ActuatorDelay() {
  return {
      .name = "actuator.delay",
      .summary = "An actuator reacts late.",
      .semantics =
          "Models a motor controller or servo that takes time to accept a command. In each step of the "
          "window, the actuator's force or torque is the command that was in force in the step `delay_ms` "
          "before, in or before the window. When `delay_ms` is not a multiple of the plant's step, it is the "
          "next earlier one. As long as there is none, it is the first command of all. After the window, the "
          "command takes effect at once.",
      .source =
          "Nilsson, Real-Time Control Systems with Delays, Ph.D. thesis, Lund Institute of Technology, 1998.",
      .parameters = {ActuatorParameter(),
                     {.name = "delay_ms",
                      .unit = "ms",
                      .min = 0.0,
                      .max = 10'000.0,
                      .doc = "how late commands take effect",
                      .example = 50.0,
                      .zero = 0.0,
                      .severity = Scale::kLogarithmic}},
      .kind = ActuatorKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<ActuatorModel> {
        return std::make_unique<LateActuator>(setup);
      }}};
}

}  // namespace tiltproof::faults
