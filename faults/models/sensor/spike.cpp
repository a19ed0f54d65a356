#include "faults/fault_type.h"
#include "faults/poisson.h"
#include "faults/signal_choice.h"

namespace tiltproof::faults {
namespace {

class SpikingSensor : public SensorModel {
 public:
  explicit SpikingSensor(const SignalSetup& setup)
      : signal_(SensorIndex(setup)),
        magnitude_(setup.parameters.Number("magnitude")),
        spikes_(setup.parameters.Number("rate_hz"), setup.stream) {}

  void Act(std::span<double> values, const SampleContext& context) override {
    if (context.period_ns == 0) return;
    const BootTime end(context.time_ns + 1);
    events_.clear();
    spikes_.In(end - context.period_ns, end, events_);
    if (events_.empty()) return;
    const double sign = Random(events_.front().key).Bernoulli(0.5) ? 1 : -1;
    double& value = values[signal_];
    value += sign * magnitude_;
  }

 private:
  std::size_t signal_;
  double magnitude_;
  PoissonEvents spikes_;  // in simulation time
  std::vector<PoissonEvents::Event> events_;
};

}  // namespace

FaultType SensorSpike() {
  return {.name = "sensor.spike",
          .summary = "A sensor has single wild values at random times.",
          .semantics =
              "Models interference, as from a motor or a radio, that spoils single samples. Spikes come at "
              "random times, as a Poisson process of `rate_hz` over the time of the flight from t = 0 on, "
              "not over the samples. A sample that the trigger picks is off by `magnitude`, up or down with "
              "equal probability. This happens when one or more spikes came after the sample before it, and "
              "not later than this one. The sum is rounded to the 32 bits of the line. With samples every T "
              "seconds, a sample is hit with the probability 1 - exp(-`rate_hz` T).",
          .source =
              "Ni et al., Sensor Network Data Fault Types, ACM Transactions on Sensor Networks 5(3), 2009 "
              "(spike).",
          .parameters = {SensorParameter(),
                         {.name = "magnitude",
                          .unit = "of the signal",
                          .min = 0.0,
                          .max = 1e6,
                          .doc = "how far off a hit sample is",
                          .example = 5.0,
                          .zero = 0.0,
                          .severity = Scale::kLogarithmic},
                         {.name = "rate_hz",
                          .unit = "Hz",
                          .min = 0.0,
                          .max = 10'000.0,
                          .doc = "spikes per second on average",
                          .example = 5.0,
                          .zero = 0.0}},
          .kind = SensorKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<SensorModel> {
            return std::make_unique<SpikingSensor>(setup);
          }}};
}

}  // namespace tiltproof::faults
