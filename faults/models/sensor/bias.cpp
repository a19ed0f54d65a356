#include "faults/fault_type.h"
#include "faults/signal_choice.h"

namespace tiltproof::faults {
namespace {

class Bias : public SensorModel {
 public:
  explicit Bias(const SignalSetup& setup)
      : signal_(SensorIndex(setup)), offset_(setup.parameters.Number("offset")) {}

  void Act(std::span<double> values, const SampleContext& /*context*/) override {
    double& value = values[signal_];
    value += offset_;
  }

 private:
  std::size_t signal_;
  double offset_;
};

}  // namespace

FaultType SensorBias() {
  return {.name = "sensor.bias",
          .summary = "Adds a constant to a sensor.",
          .semantics =
              "Models a wrong zero: a sensor out of trim, or an altimeter that is set to the wrong pressure. "
              "`offset` is added to the signal in every sample that the trigger picks, before the sample is "
              "sent. The sum is rounded to the 32 bits of the line.",
          .source =
              "Isermann, Fault-Diagnosis Systems, Springer, 2006 (additive faults); Balaban et al., "
              "Modeling, Detection, and Disambiguation of Sensor Faults for Aerospace Applications, IEEE "
              "Sensors Journal 9(12), 2009.",
          .parameters = {SensorParameter(),
                         {.name = "offset",
                          .unit = "of the signal",
                          .min = -1e6,
                          .max = 1e6,
                          .doc = "the value that is added, in the signal's unit",
                          .example = 0.5,
                          .zero = 0.0,
                          .severity = Scale::kLinear}},
          .kind = SensorKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<SensorModel> {
            return std::make_unique<Bias>(setup);
          }}};
}

}  // namespace tiltproof::faults
