#include "faults/fault_type.h"
#include "faults/signal_choice.h"

namespace tiltproof::faults {
namespace {

class StuckSensor : public SensorModel {
 public:
  explicit StuckSensor(const SignalSetup& setup)
      : signal_(SensorIndex(setup)), value_(setup.parameters.Number("value")) {}

  void Act(std::span<double> values, const SampleContext& /*context*/) override { values[signal_] = value_; }

 private:
  std::size_t signal_;
  double value_;
};

}  // namespace

FaultType SensorStuckAt() {
  return {.name = "sensor.stuck_at",
          .summary = "A sensor reads one fixed value.",
          .semantics =
              "Models a sensor whose output is shorted to a supply rail, or whose converter hangs at "
              "one end. In every sample that the trigger picks, the signal is `value`, rounded to the "
              "32 bits of the line, whatever the truth. sensor.freeze keeps the last true value "
              "instead.",
          .source =
              "Ni et al., Sensor Network Data Fault Types, ACM Transactions on Sensor Networks 5(3), "
              "2009 (stuck-at); Balaban et al., Modeling, Detection, and Disambiguation of Sensor "
              "Faults for Aerospace Applications, IEEE Sensors Journal 9(12), 2009.",
          .parameters = {SensorParameter(),
                         {.name = "value",
                          .unit = "of the signal",
                          .min = -1e6,
                          .max = 1e6,
                          .doc = "what the sensor reads",
                          .example = 0.0}},
          .kind = SensorKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<SensorModel> {
            return std::make_unique<StuckSensor>(setup);
          }}};
}

}  // namespace tiltproof::faults
