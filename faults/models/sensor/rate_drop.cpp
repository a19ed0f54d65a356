#include "faults/active_time.h"
#include "faults/fault_type.h"
#include "faults/signal_choice.h"

namespace tiltproof::faults {
namespace {

class SlowSensor : public SensorModel {
 public:
  explicit SlowSensor(const SignalSetup& setup)
      : signal_(SensorIndex(setup)), period_ns_(FromSeconds(setup.parameters.Number("period_ms") * 1e-3)) {}

  void Act(std::span<double> values, const SampleContext& context) override {
    Update(values, context);
    values[signal_] = held_;
  }
  void Pass(std::span<const double> values, const SampleContext& context) override {
    Update(values, context);
  }

 private:
  void Update(std::span<const double> values, const SampleContext& context) {
    const auto elapsed_ns = time_.At(context);
    const std::int64_t turn = !elapsed_ns || period_ns_ == 0 ? kNone : *elapsed_ns / period_ns_;
    if (turn == turn_ && turn != kNone) return;
    turn_ = turn;
    held_ = values[signal_];
  }

  static constexpr std::int64_t kNone = -1;

  std::size_t signal_;
  TimeNs period_ns_;
  ActiveTime time_;
  std::int64_t turn_ = kNone;  // whole periods in the window at the latest sample
  double held_ = 0;
};

}  // namespace

FaultType SensorRateDrop() {
  return {.name = "sensor.rate_drop",
          .summary = "A sensor delivers new values less often.",
          .semantics =
              "Models a sensor or bus that falls back to a lower rate. The time in the window, from its "
              "first sample on, is divided into periods of `period_ms`. The first sample in each period is "
              "true, and the others in that period read the same as it. Samples come when the firmware asks: "
              "periods shorter than its own change nothing. With samples every 12 ms and a period of 30 ms, "
              "the samples at 0, 36, 60 and 96 ms are true. They are counted again after each sample outside "
              "the fault's active time, so in each period of an intermittent fault, and each time that a "
              "condition holds again.",
          .source =
              "Astrom and Wittenmark, Computer-Controlled Systems, 3rd ed., Prentice Hall, 1997 (multirate "
              "sampling).",
          .parameters = {SensorParameter(),
                         {.name = "period_ms",
                          .unit = "ms",
                          .min = 0.0,
                          .max = 600'000.0,
                          .doc = "time between new values",
                          .example = 100.0,
                          .zero = 0.0,
                          .severity = Scale::kLogarithmic}},
          .kind = SensorKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<SensorModel> {
            return std::make_unique<SlowSensor>(setup);
          }}};
}

}  // namespace tiltproof::faults
