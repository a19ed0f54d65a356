#include <cmath>

#include "faults/active_time.h"
#include "faults/fault_type.h"
#include "faults/signal_choice.h"

namespace tiltproof::faults {
namespace {

class WalkingSensor : public SensorModel {
 public:
  explicit WalkingSensor(const SignalSetup& setup)
      : signal_(SensorIndex(setup)), density_(setup.parameters.Number("density")) {}

  void Act(std::span<double> values, const SampleContext& context) override {
    Walk(context);
    double& value = values[signal_];
    value += error_;
  }
  void Pass(std::span<const double> /*values*/, const SampleContext& context) override { Walk(context); }

 private:
  void Walk(const SampleContext& context) {
    const auto elapsed_ns = time_.At(context);
    if (!elapsed_ns || *elapsed_ns == 0)
      error_ = 0;
    else
      error_ += density_ * std::sqrt(ToSeconds(context.period_ns)) * context.random.StandardNormal();
  }

  std::size_t signal_;
  double density_;
  ActiveTime time_;
  double error_ = 0;
};

}  // namespace

FaultType SensorRandomWalk() {
  return {.name = "sensor.random_walk",
          .summary = "A sensor's error wanders off in random steps.",
          .semantics =
              "Models the bias of a gyro or accelerometer that wanders with its electronics and temperature. "
              "The error is 0 in the first sample of the window. At each further sample, dt after the sample "
              "before it, the error grows by a random step. The step is normally distributed, with mean 0 "
              "and standard deviation `density` times the square root of dt, and independent of other steps. "
              "After T seconds in the window the error has the standard deviation `density` times the square "
              "root of T. The signal is the true value plus the error, rounded to the 32 bits of the line. "
              "Samples that the trigger leaves out are unchanged, but the error goes on. It starts again at "
              "0 after each sample outside the fault's active time, so in each period of an intermittent "
              "fault, and each time that a condition holds again.",
          .source = "IEEE Std 952-1997, Annex C (rate random walk).",
          .parameters = {SensorParameter(),
                         {.name = "density",
                          .unit = "of the signal, 1/sqrt(s)",
                          .min = 0.0,
                          .max = 1e6,
                          .doc = "standard deviation of the error after one second",
                          .example = 0.05,
                          .zero = 0.0,
                          .severity = Scale::kLogarithmic}},
          .kind = SensorKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<SensorModel> {
            return std::make_unique<WalkingSensor>(setup);
          }}};
}

}  // namespace tiltproof::faults
