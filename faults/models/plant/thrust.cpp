#include "faults/fault_type.h"
#include "faults/signal_choice.h"

namespace tiltproof::faults {
namespace {

class RotorThrust : public PlantModel {
 public:
  explicit RotorThrust(const SignalSetup& setup) {
    disturbance_.thrust_factor[RotorIndex(setup)] = setup.parameters.Number("factor");
  }

  Disturbance Act(const StepContext& /*context*/) override { return disturbance_; }

 private:
  Disturbance disturbance_;
};

}  // namespace

FaultType PlantThrust() {
  return {.name = "plant.thrust",
          .summary = "A rotor gives less thrust than commanded.",
          .semantics =
              "Models a chipped or iced blade, a worn motor or an empty battery. In every step that the "
              "trigger picks, the rotor gives `factor` times the thrust in force, after the vehicle's "
              "limits, and `factor` times the drag torque that goes with it. The input in the trace (f_r_n "
              "for the right rotor of the tilt-rotor) is the thrust in force before the factor: unlike "
              "actuator.loss_of_effectiveness, this fault is not seen there. Each time that the factor "
              "begins to apply is one activation.",
          .source =
              "Ducard, Fault-tolerant Flight Control and Guidance Systems, Springer, 2009 (loss of "
              "effectiveness).",
          .parameters = {RotorParameter(),
                         {.name = "factor",
                          .unit = "1",
                          .min = 0.0,
                          .max = 1.0,
                          .doc = "what the thrust is multiplied by",
                          .example = 0.5,
                          .zero = 1.0,
                          .severity = Scale::kLinear}},
          .kind = PlantKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<PlantModel> {
            return std::make_unique<RotorThrust>(setup);
          }}};
}

}  // namespace tiltproof::faults
