#include <cmath>

#include "faults/fault_type.h"
#include "faults/signal_choice.h"

namespace tiltproof::faults {
namespace {

class QuantisedSensor : public SensorModel {
 public:
  explicit QuantisedSensor(const SignalSetup& setup)
      : signal_(SensorIndex(setup)), step_(setup.parameters.Number("step")) {}

  void Act(std::span<double> values, const SampleContext& /*context*/) override {
    double& value = values[signal_];
    // From 2^53 on the multiple is a whole number anyway, and the step below the resolution.
    const double multiple = value / step_;
    if (std::abs(multiple) < 0x1p53) value = Rounded(multiple) * step_;
  }

 private:
  static double Rounded(double x) {
    const double below = std::floor(x);
    return x - below >= 0.5 ? below + 1 : below;
  }

  std::size_t signal_;
  double step_;
};

}  // namespace

FaultType SensorQuantise() {
  return {.name = "sensor.quantise",
          .summary = "A sensor reads only multiples of a step.",
          .semantics =
              "Models a converter with too few bits. In every sample that the trigger picks, the signal is "
              "the multiple of `step` nearest to the true value; of two equally near ones, the upper one. "
              "The product is rounded to the 32 bits of the line. A `step` of 0 changes nothing.",
          .source =
              "Widrow and Kollar, Quantization Noise, Cambridge University Press, 2008; IEEE Std 952-1997, "
              "Annex C (quantization).",
          .parameters = {SensorParameter(),
                         {.name = "step",
                          .unit = "of the signal",
                          .min = 0.0,
                          .max = 1e6,
                          .doc = "distance between neighbouring readings; 0 changes nothing",
                          .example = 0.5,
                          .zero = 0.0,
                          .severity = Scale::kLogarithmic}},
          .kind = SensorKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<SensorModel> {
            return std::make_unique<QuantisedSensor>(setup);
          }}};
}

}  // namespace tiltproof::faults
