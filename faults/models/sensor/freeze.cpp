#include "faults/model.h"
#include "faults/signal_choice.h"

namespace tiltproof::faults {
namespace {

class Freeze : public SensorModel {
 public:
  explicit Freeze(const Parameters& parameters) : signal_(SensorNamed(parameters.Choice("signal"))) {}

  void Act(Sensors& sensors) override {
    if (!frozen_) frozen_ = sensors.*signal_;
    sensors.*signal_ = *frozen_;
  }

 private:
  float Sensors::*signal_;
  std::optional<float> frozen_;
};

}  // namespace

FaultType SensorFreeze() {
  return {.name = "sensor.freeze",
          .stage = Stage::kSensor,
          .summary = "A sensor keeps its value.",
          .semantics =
              "The signal keeps the value that it had in the first sample that the trigger picked. "
              "That sample itself is unchanged, and so counts as no activation.",
          .parameters = {SensorParameter()},
          .make_sensor = [](const Parameters& parameters) -> std::unique_ptr<SensorModel> {
            return std::make_unique<Freeze>(parameters);
          }};
}

}  // namespace tiltproof::faults
