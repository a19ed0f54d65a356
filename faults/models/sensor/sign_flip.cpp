#include "faults/fault_type.h"
#include "faults/signal_choice.h"

namespace tiltproof::faults {
namespace {

class NegatedSensor : public SensorModel {
 public:
  explicit NegatedSensor(const SignalSetup& setup) : signal_(SensorIndex(setup)) {}

  void Act(std::span<double> values, const SampleContext& /*context*/) override {
    values[signal_] = -values[signal_];
  }

 private:
  std::size_t signal_;
};

}  // namespace

FaultType SensorSignFlip() {
  return {.name = "sensor.sign_flip",
          .summary = "A sensor reads with the wrong sign.",
          .semantics =
              "Models a sensor that is mounted the wrong way round, or a wrong sign in its driver. In "
              "every sample that the trigger picks, the signal is the negative of the true value.",
          .source =
              "Genesis Mishap Investigation Board Report, Volume I, NASA, 2005 (gravity switches in an "
              "inverted orientation).",
          .parameters = {SensorParameter()},
          .kind = SensorKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<SensorModel> {
            return std::make_unique<NegatedSensor>(setup);
          }}};
}

}  // namespace tiltproof::faults
