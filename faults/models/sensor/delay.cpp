#include "faults/delay_line.h"
#include "faults/fault_type.h"
#include "faults/signal_choice.h"

namespace tiltproof::faults {
namespace {

class LateSensor : public SensorModel {
 public:
  explicit LateSensor(const SignalSetup& setup)
      : signal_(SensorIndex(setup)), past_(FromSeconds(setup.parameters.Number("delay_ms") * 1e-3)) {}

  void Act(std::span<double> values, const SampleContext& context) override {
    Push(values, context);
    values[signal_] = past_.Delayed();
  }
  void Pass(std::span<const double> values, const SampleContext& context) override { Push(values, context); }

 private:
  void Push(std::span<const double> values, const SampleContext& context) {
    past_.Push(now_ns_ += context.period_ns, values[signal_]);
  }

  std::size_t signal_;
  DelayLine<double> past_;
  TimeNs now_ns_ = 0;  // since the first sample
};

}  // namespace

FaultType SensorDelay() {
  return {.name = "sensor.delay",
          .summary = "A sensor reads the past.",
          .semantics =
              "Models a sensor with a slow filter or a slow bus, whose values are old when they are "
              "read. In every sample that the trigger picks, the signal is the value of the latest "
              "sample taken at least `delay_ms` earlier, in or before the window. As long as there is "
              "none, it is the value of the first sample of all. Only samples are remembered: with "
              "samples every 12 ms, a delay of 20 ms reads the value of 24 ms ago. Messages are not "
              "late: frame.delay delays these.",
          .source =
              "Nilsson, Real-Time Control Systems with Delays, Ph.D. thesis, Lund Institute of "
              "Technology, 1998.",
          .parameters = {SensorParameter(),
                         {.name = "delay_ms",
                          .unit = "ms",
                          .min = 0.0,
                          .max = 10'000.0,
                          .doc = "how old the value is at least",
                          .example = 50.0,
                          .zero = 0.0,
                          .severity = Scale::kLogarithmic}},
          .kind = SensorKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<SensorModel> {
            return std::make_unique<LateSensor>(setup);
          }}};
}

}  // namespace tiltproof::faults
