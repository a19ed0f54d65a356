#include <utility>

#include "faults/fault_type.h"
#include "faults/signal_choice.h"

namespace tiltproof::faults {
namespace {

ParameterInfo WithParameter() {
  ParameterInfo with = OneSensorParameter();
  with.name = "with";
  with.doc = "the other sensor, by its trace column";
  with.example = "x_m";
  return with;
}

class SwappedSensors : public SensorModel {
 public:
  explicit SwappedSensors(const SignalSetup& setup)
      : signal_(SensorIndex(setup)), with_(SensorIndex(setup, "with")) {}

  void Act(std::span<double> values, const SampleContext& /*context*/) override {
    std::swap(values[signal_], values[with_]);
  }

 private:
  std::size_t signal_, with_;
};

}  // namespace

FaultType SensorSwap() {
  return {.name = "sensor.swap",
          .summary = "Two sensors are exchanged.",
          .semantics =
              "Models crossed cables, or two channels of a converter that are exchanged. In every "
              "sample that the trigger picks, `signal` reads the true value of `with`, and `with` that "
              "of `signal`, whatever their units.",
          .source =
              "German Federal Bureau of Aircraft Accidents Investigation, report 5X004-0/01, 2003 (two "
              "wires of a sidestick, exchanged in a plug).",
          .parameters = {OneSensorParameter(), WithParameter()},
          .kind = SensorKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<SensorModel> {
            return std::make_unique<SwappedSensors>(setup);
          }}};
}

}  // namespace tiltproof::faults
