#include "faults/active_time.h"
#include "faults/fault_type.h"
#include "faults/signal_choice.h"

namespace tiltproof::faults {
namespace {

class DriftingSensor : public SensorModel {
 public:
  explicit DriftingSensor(const SignalSetup& setup)
      : signal_(SensorIndex(setup)), rate_per_s_(setup.parameters.Number("rate_per_s")) {}

  void Act(std::span<double> values, const SampleContext& context) override {
    const double error = rate_per_s_ * ToSeconds(time_.At(context).value_or(0));
    double& value = values[signal_];
    value += error;
  }
  void Pass(std::span<const double> /*values*/, const SampleContext& context) override { time_.At(context); }

 private:
  std::size_t signal_;
  double rate_per_s_;
  ActiveTime time_;
};

}  // namespace

FaultType SensorDrift() {
  return {.name = "sensor.drift",
          .summary = "A sensor's error grows steadily.",
          .semantics =
              "Models a sensor that warms up or ages: its zero moves at a constant rate. The error is "
              "`rate_per_s` times the time since the first sample in the window, so this first sample is "
              "unchanged. The signal is the true value plus the error, rounded to the 32 bits of the line. "
              "It starts again at 0 after each sample outside the fault's active time, so in each period of "
              "an intermittent fault, and each time that a condition holds again. After the window the "
              "signal is correct at once.",
          .source =
              "IEEE Std 952-1997, Annex C (rate ramp); Balaban et al., Modeling, Detection, and "
              "Disambiguation of Sensor Faults for Aerospace Applications, IEEE Sensors Journal 9(12), 2009.",
          .parameters = {SensorParameter(),
                         {.name = "rate_per_s",
                          .unit = "of the signal, 1/s",
                          .min = -1e6,
                          .max = 1e6,
                          .doc = "how much the error grows per second",
                          .example = 0.1,
                          .zero = 0.0,
                          .severity = Scale::kLinear}},
          .kind = SensorKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<SensorModel> {
            return std::make_unique<DriftingSensor>(setup);
          }}};
}

}  // namespace tiltproof::faults
