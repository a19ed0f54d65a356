#include <bit>

#include "faults/fault_type.h"
#include "faults/signal_choice.h"

namespace tiltproof::faults {
namespace {

class GarbageSensor : public SensorModel {
 public:
  explicit GarbageSensor(const SignalSetup& setup)
      : signal_(SensorIndex(setup)), probability_(setup.parameters.Number("probability")) {}

  void Act(std::span<double> values, const SampleContext& context) override {
    if (!context.random.Bernoulli(probability_)) return;
    values[signal_] =
        static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(context.random() >> 32)));
  }

 private:
  std::size_t signal_;
  double probability_;
};

}  // namespace

FaultType SensorGarbage() {
  return {
      .name = "sensor.garbage",
      .summary = "A sensor reads random bits from time to time.",
      .semantics =
          "Models a transfer from the sensor that goes wrong without a checksum to tell, or a read from the "
          "wrong register. Each sample that the trigger picks is replaced with `probability`, independently "
          "of others, by 32 random bits, taken as a binary32 number. Each pattern is equally likely, so the "
          "value is huge or tiny more often than plausible, and NaN or infinite in one case of 256.",
      .source =
          "Avizienis et al., Basic Concepts and Taxonomy of Dependable and Secure Computing, IEEE "
          "Transactions on Dependable and Secure Computing 1(1), 2004 (content failures).",
      .parameters = {SensorParameter(), ProbabilityParameter("probability that a sample is replaced", 0.1)},
      .kind = SensorKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<SensorModel> {
        return std::make_unique<GarbageSensor>(setup);
      }}};
}

}  // namespace tiltproof::faults
