#include "faults/fault_type.h"
#include "faults/signal_choice.h"

namespace tiltproof::faults {
namespace {

class ScaledSensor : public SensorModel {
 public:
  explicit ScaledSensor(const SignalSetup& setup)
      : signal_(SensorIndex(setup)), factor_(setup.parameters.Number("factor")) {}

  void Act(std::span<double> values, const SampleContext& /*context*/) override {
    double& value = values[signal_];
    value *= factor_;
  }

 private:
  std::size_t signal_;
  double factor_;
};

}  // namespace

FaultType SensorScale() {
  return {.name = "sensor.scale",
          .summary = "A sensor reads a multiple of the true value.",
          .semantics =
              "Models a wrong scale factor: a sensor out of calibration, or one set to another range "
              "than its driver expects. In every sample that the trigger picks, the signal is `factor` "
              "times the true value, rounded to the 32 bits of the line.",
          .source =
              "IEEE Std 1431-2004 (scale factor); Balaban et al., Modeling, Detection, and "
              "Disambiguation of Sensor Faults for Aerospace Applications, IEEE Sensors Journal 9(12), "
              "2009.",
          .parameters = {SensorParameter(),
                         {.name = "factor",
                          .unit = "1",
                          .min = 0.001,
                          .max = 1000.0,
                          .doc = "what the true value is multiplied by; 1 changes nothing",
                          .example = 1.5,
                          .zero = 1.0,
                          .severity = Scale::kLogarithmic}},
          .kind = SensorKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<SensorModel> {
            return std::make_unique<ScaledSensor>(setup);
          }}};
}

}  // namespace tiltproof::faults
