#include "faults/model.h"
#include "faults/signal_choice.h"

namespace tiltproof::faults {
namespace {

class Bias : public SensorModel {
 public:
  explicit Bias(const Parameters& parameters)
      : signal_(SensorNamed(parameters.Choice("signal"))), offset_(parameters.Number("offset")) {}

  void Act(Sensors& sensors) override {
    float& value = sensors.*signal_;
    value = static_cast<float>(static_cast<double>(value) + offset_);
  }

 private:
  float Sensors::*signal_;
  double offset_;
};

}  // namespace

FaultType SensorBias() {
  return {.name = "sensor.bias",
          .stage = Stage::kSensor,
          .summary = "Adds a constant to a sensor.",
          .semantics =
              "`offset` is added to the signal in every sample that the trigger picked, before it "
              "is sent; the sum is rounded to the line's 32 bits.",
          .parameters = {SensorParameter(),
                         {.name = "offset",
                          .unit = "of the signal",
                          .min = -1e6,
                          .max = 1e6,
                          .doc = "what is added, in the signal's unit",
                          .example = 0.5,
                          .zero = 0.0}},
          .make_sensor = [](const Parameters& parameters) -> std::unique_ptr<SensorModel> {
            return std::make_unique<Bias>(parameters);
          }};
}

}  // namespace tiltproof::faults
