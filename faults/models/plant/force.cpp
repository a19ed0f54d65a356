#include "faults/direction.h"
#include "faults/fault_type.h"

namespace tiltproof::faults {
namespace {

class Force : public PlantModel {
 public:
  explicit Force(const Parameters& parameters) {
    disturbance_.force_n = AlongDirection(parameters, parameters.Number("force_n"));
  }

  Disturbance Act(const StepContext& /*context*/) override { return disturbance_; }

 private:
  Disturbance disturbance_;
};

}  // namespace

FaultType PlantForce() {
  return {
      .name = "plant.force",
      .summary = "Pushes the vehicle.",
      .semantics =
          "Models a push from outside: a rope, a hand, a bump. In every step that the trigger picks, a force "
          "of `force_n` acts at the main body's centre of "
          "mass, along `direction` in the world (z up), whatever the vehicle's attitude. Each time that "
          "the force begins to act is one activation.",
      .source =
          "Etkin, Dynamics of Atmospheric Flight, Wiley, 1972 (external forces in the equations of motion).",
      .parameters = {{.name = "force_n",
                      .unit = "N",
                      .min = 0.0,
                      .max = 1e4,
                      .doc = "magnitude of the force",
                      .example = 2.0,
                      .zero = 0.0,
                      .severity = Scale::kLinear},
                     DirectionParameter("direction of the force, in the world; its length does not matter",
                                        {0.0, 1.0, 0.0})},
      .kind = PlantKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<PlantModel> {
        return std::make_unique<Force>(setup.parameters);
      }}};
}

}  // namespace tiltproof::faults
