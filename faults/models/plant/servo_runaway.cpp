#include "faults/fault_type.h"
#include "faults/signal_choice.h"

namespace tiltproof::faults {
namespace {

class ServoRunaway : public PlantModel {
 public:
  explicit ServoRunaway(const SignalSetup& setup) {
    const double rate_rad_s = setup.parameters.Number("rate_rad_s");
    if (rate_rad_s != 0) disturbance_.hinges[JointIndex(setup)] = {.held = true, .rate_rad_s = rate_rad_s};
  }

  Disturbance Act(const StepContext& /*context*/) override { return disturbance_; }

 private:
  Disturbance disturbance_;
};

}  // namespace

FaultType PlantServoRunaway() {
  return {
      .name = "plant.servo_runaway",
      .summary = "A servo turns on its own.",
      .semantics =
          "Models a servo with a broken potentiometer or a failed drive. In every step that the trigger "
          "picks, the joint turns with `rate_rad_s`, until it meets its stop, where it stays. It turns "
          "against every command and against torques up to 100 N m. The sign is that of the joint's angle in "
          "the trace. After the window, the joint is free at once. A rate of 0 is no fault: the joint then "
          "follows its servo (plant.servo_jam holds it). Each time that the joint begins to run away is one "
          "activation.",
      .source =
          "Ducard, Fault-tolerant Flight Control and Guidance Systems, Springer, 2009 (hard-over, runaway).",
      .parameters = {JointParameter(),
                     {.name = "rate_rad_s",
                      .unit = "rad/s",
                      .min = -100.0,
                      .max = 100.0,
                      .doc = "how fast the joint turns",
                      .example = 0.5,
                      .zero = 0.0,
                      .severity = Scale::kLogarithmic}},
      .kind = PlantKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<PlantModel> {
        return std::make_unique<ServoRunaway>(setup);
      }}};
}

}  // namespace tiltproof::faults
