#include "faults/active_time.h"
#include "faults/fault_type.h"
#include "faults/signal_choice.h"

namespace tiltproof::faults {
namespace {

class SpoofedSensor : public SensorModel {
 public:
  explicit SpoofedSensor(const SignalSetup& setup)
      : signals_(PositionSensorIndices(setup)), rate_per_s_(setup.parameters.Number("rate_per_s")) {}

  void Act(std::span<double> values, const SampleContext& context) override {
    const double pulled = rate_per_s_ * ToSeconds(time_.At(context).value_or(0));
    Add(pulled, values[signals_.position]);
    if (signals_.velocity) Add(rate_per_s_, values[*signals_.velocity]);
  }
  void Pass(std::span<const double> /*values*/, const SampleContext& context) override { time_.At(context); }

 private:
  static void Add(double offset, double& value) { value += offset; }

  PositionIndices signals_;
  double rate_per_s_;
  ActiveTime time_;
};

}  // namespace

FaultType SensorSpoof() {
  return {.name = "sensor.spoof",
          .summary = "A position is pulled away slowly, with a velocity that fits.",
          .semantics =
              "Models a transmitter that takes over a satellite receiver at its true place, and then pulls "
              "it away so slowly that no check of jumps finds it. The position has an error of `rate_per_s` "
              "times the time since the first sample in the window. The velocity along the same axis, where "
              "the vehicle measures it (vx_m_s for x_m), has the error `rate_per_s`, so position and "
              "velocity fit each other. Both sums are rounded to the 32 bits of the line. The pull starts "
              "again at 0 after each sample outside the fault's active time, so in each period of an "
              "intermittent fault, and each time that a condition holds again. After the window both are "
              "correct at once. sensor.drift moves the position alone.",
          .source =
              "Kerns, Shepard, Bhatti and Humphreys, Unmanned Aircraft Capture and Control Via GPS Spoofing, "
              "Journal of Field Robotics 31(4), 2014.",
          .parameters = {PositionParameter(),
                         {.name = "rate_per_s",
                          .unit = "m/s",
                          .min = -1000.0,
                          .max = 1000.0,
                          .doc = "how fast the position is pulled",
                          .example = 0.1,
                          .zero = 0.0,
                          .severity = Scale::kLinear}},
          .kind = SensorKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<SensorModel> {
            return std::make_unique<SpoofedSensor>(setup);
          }}};
}

}  // namespace tiltproof::faults
