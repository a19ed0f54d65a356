#include <limits>

#include "faults/fault_type.h"
#include "faults/signal_choice.h"

namespace tiltproof::faults {
namespace {

class DroppingSensor : public SensorModel {
 public:
  explicit DroppingSensor(const SignalSetup& setup)
      : signal_(SensorIndex(setup)),
        probability_(setup.parameters.Number("probability")),
        reads_(setup.parameters.Choice("reads")) {}

  void Act(std::span<double> values, const SampleContext& context) override {
    if (context.random.Bernoulli(probability_))
      values[signal_] = Reading();
    else
      last_ = values[signal_];
  }
  void Pass(std::span<const double> values, const SampleContext& /*context*/) override {
    last_ = values[signal_];
  }

 private:
  double Reading() const {
    if (reads_ == "nan") return std::numeric_limits<double>::quiet_NaN();
    return reads_ == "zero" ? 0.0 : last_;
  }

  std::size_t signal_;
  double probability_;
  std::string reads_;
  double last_ = 0;  // of the latest sample that was not lost
};

}  // namespace

FaultType SensorDropout() {
  return {.name = "sensor.dropout",
          .summary = "A sensor has no new reading from time to time.",
          .semantics =
              "Models a loose contact or a sensor that misses its deadline, and the driver's answer to it. "
              "Each sample that the trigger picks is lost with `probability`, independently of others. The "
              "reading of a lost sample depends on `reads`. With `last` it is the value of the latest sample "
              "that was not lost, also from before the window, or 0 when there is none yet. With `zero` it "
              "is 0, with `nan` it is NaN.",
          .source =
              "Balaban et al., Modeling, Detection, and Disambiguation of Sensor Faults for Aerospace "
              "Applications, IEEE Sensors Journal 9(12), 2009; Schenato, To Zero or to Hold Control Inputs "
              "With Lossy Links?, IEEE Transactions on Automatic Control 54(5), 2009.",
          .parameters = {SensorParameter(),
                         ProbabilityParameter("probability that a sample is lost", 0.3),
                         {.name = "reads",
                          .unit = "",
                          .kind = ParameterKind::kChoice,
                          .doc = "what a lost sample reads",
                          .example = "last",
                          .default_value = "last",
                          .choices = {"last", "zero", "nan"}}},
          .kind = SensorKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<SensorModel> {
            return std::make_unique<DroppingSensor>(setup);
          }}};
}

}  // namespace tiltproof::faults
