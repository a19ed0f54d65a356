#include "faults/model.h"

namespace tiltproof::faults {
namespace {

class Null : public SensorModel {
 public:
  void Act(Sensors& /*sensors*/) override {}
};

}  // namespace

FaultType HarnessNull() {
  return {.name = "harness.null",
          .stage = Stage::kSensor,
          .summary = "Changes nothing: a flight with it must equal one without.",
          .semantics =
              "Passes through triggers and records as any fault of the sensors does, and counts as "
              "activated in every sample that the trigger picked.",
          .make_sensor = [](const Parameters&) -> std::unique_ptr<SensorModel> {
            return std::make_unique<Null>();
          },
          .always_counts = true};
}

}  // namespace tiltproof::faults
