#include "faults/fault_type.h"
#include "faults/signal_choice.h"

namespace tiltproof::faults {
namespace {

class Noise : public SensorModel {
 public:
  explicit Noise(const SignalSetup& setup)
      : signal_(SensorIndex(setup)), std_(setup.parameters.Number("std")) {}

  void Act(std::span<float> values, const SampleContext& context) override {
    float& value = values[signal_];
    value = static_cast<float>(static_cast<double>(value) + std_ * context.random.StandardNormal());
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
              "To the signal a normal draw of mean 0 and standard deviation `std` is added in every sample "
              "that the "
              "trigger picked, independent from sample to sample; the sum is rounded to the line's 32 bits.",
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
