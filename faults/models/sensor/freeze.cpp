#include "faults/fault_type.h"
#include "faults/signal_choice.h"

namespace tiltproof::faults {
namespace {

class Freeze : public SensorModel {
 public:
  explicit Freeze(const SignalSetup& setup) : signal_(SensorIndex(setup)) {}

  void Act(std::span<double> values, const SampleContext& /*context*/) override {
    if (!frozen_) frozen_ = values[signal_];
    values[signal_] = *frozen_;
  }

 private:
  std::size_t signal_;
  std::optional<double> frozen_;
};

}  // namespace

FaultType SensorFreeze() {
  return {.name = "sensor.freeze",
          .summary = "A sensor keeps its value.",
          .semantics =
              "Models a driver or bus that keeps serving its last buffer. The signal keeps the value of the "
              "first sample that the trigger picked. That sample itself "
              "is unchanged, so it does not count as an activation.",
          .source =
              "Balaban et al., Modeling, Detection, and Disambiguation of Sensor Faults for Aerospace "
              "Applications, IEEE Sensors Journal 9(12), 2009.",
          .parameters = {SensorParameter()},
          .kind = SensorKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<SensorModel> {
            return std::make_unique<Freeze>(setup);
          }}};
}

}  // namespace tiltproof::faults
