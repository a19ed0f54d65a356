#include <algorithm>

#include "faults/fault_type.h"
#include "faults/signal_choice.h"

namespace tiltproof::faults {
namespace {

class SaturatedSensor : public SensorModel {
 public:
  explicit SaturatedSensor(const SignalSetup& setup)
      : signal_(SensorIndex(setup)), limit_(setup.parameters.Number("limit")) {}

  void Act(std::span<double> values, const SampleContext& /*context*/) override {
    double& value = values[signal_];
    value = std::clamp(value, -limit_, limit_);
  }

 private:
  std::size_t signal_;
  double limit_;
};

}  // namespace

FaultType SensorSaturate() {
  return {.name = "sensor.saturate",
          .summary = "A sensor cannot read beyond a limit.",
          .semantics =
              "Models a measuring range that is too small, as of a gyro that is set to 250 deg/s. In "
              "every sample that the trigger picks, a value above `limit` reads `limit`, and one below "
              "-`limit` reads -`limit`, each rounded to the 32 bits of the line.",
          .source =
              "Ni et al., Sensor Network Data Fault Types, ACM Transactions on Sensor Networks 5(3), "
              "2009 (clipping); IEEE Std 1431-2004 (input limits).",
          .parameters = {SensorParameter(),
                         {.name = "limit",
                          .unit = "of the signal",
                          .min = 0.0,
                          .max = 1e6,
                          .doc = "the largest magnitude that the sensor reads",
                          .example = 2.0,
                          .zero = 1e6,
                          .severity = Scale::kLogarithmic}},
          .kind = SensorKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<SensorModel> {
            return std::make_unique<SaturatedSensor>(setup);
          }}};
}

}  // namespace tiltproof::faults
