#include "faults/fault_type.h"
#include "faults/signal_choice.h"

namespace tiltproof::faults {
namespace {

class Noise : public SensorModel {
 public:
  explicit Noise(const SignalSetup& setup)
      : signal_(SensorIndex(setup)), std_(setup.parameters.Number("std")) {}

  void Act(std::span<double> values, const SampleContext& context) override {
    double& value = values[signal_];
    value += std_ * context.random.StandardNormal();
  }

 private:
  std::size_t signal_;
  double std_;
};

}  // namespace

FaultType SensorNoise() {
  return {.name = "sensor.noise",
          .summary = "Adds white noise to a sensor.",
          .semantics =
              "Models a noisier sensor: vibration, a bad ground, a weak signal. A random value is added to "
              "the signal in every sample that the trigger picks. It is normally "
              "distributed, with mean 0 and standard deviation `std`, and independent of the values in "
              "other samples. The sum is rounded to the 32 bits of the line.",
          .source =
              "IEEE Std 952-1997, Annex C (angle random walk is such noise on a rate); Balaban et al., "
              "Modeling, Detection, and Disambiguation of Sensor Faults for Aerospace Applications, IEEE "
              "Sensors Journal 9(12), 2009.",
          .parameters = {SensorParameter(),
                         {.name = "std",
                          .unit = "of the signal",
                          .min = 0.0,
                          .max = 1e6,
                          .doc = "standard deviation, in the signal's unit",
                          .example = 0.1,
                          .zero = 0.0,
                          .severity = Scale::kLogarithmic}},
          .kind = SensorKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<SensorModel> {
            return std::make_unique<Noise>(setup);
          }}};
}

}  // namespace tiltproof::faults
