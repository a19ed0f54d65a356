#include "faults/fault_type.h"

namespace tiltproof::faults {
namespace {

class Canary : public ActuatorModel {
 public:
  explicit Canary(const SignalTable& inputs) {
    for (std::size_t i = 0; i < inputs.size(); ++i)
      if (inputs[i].name.starts_with("f_")) thrusts_.push_back(i);
  }

  void Act(std::span<double> input, const StepContext& /*context*/) override {
    for (const std::size_t thrust : thrusts_) input[thrust] = 0.0;
  }

 private:
  std::vector<std::size_t> thrusts_;
};

}  // namespace

FaultType HarnessCanary() {
  return {.name = "harness.canary",
          .summary = "Cuts all thrusts: no flight may survive it.",
          .semantics =
              "Models the loss of every rotor: it tests the harness. All thrusts are 0 throughout the "
              "window, whatever is commanded. A verdict other than fail shows that faults or scoring do not "
              "work.",
          .source =
              "DeMillo, Lipton and Sayward, Hints on Test Data Selection: Help for the Practicing "
              "Programmer, IEEE Computer 11(4), 1978 (a seeded error that the tests must notice).",
          .kind = ActuatorKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<ActuatorModel> {
            return std::make_unique<Canary>(setup.signals.inputs);
          }}};
}

}  // namespace tiltproof::faults
