#include <cmath>

#include "faults/fault_type.h"

namespace tiltproof::faults {
namespace {

class Force : public PlantModel {
 public:
  explicit Force(const Parameters& parameters) {
    const auto& direction = parameters.Vector("direction");
    const double length = std::hypot(direction[0], direction[1], direction[2]);
    for (std::size_t i = 0; i < 3; ++i)
      disturbance_.force_n[i] = parameters.Number("force_n") * direction[i] / length;
  }

  Disturbance Act(const StepContext& /*context*/) override { return disturbance_; }

 private:
  Disturbance disturbance_;
};

}  // namespace

FaultType PlantForce() {
  return {.name = "plant.force",
          .summary = "Pushes the vehicle.",
          .semantics =
              "In every step that the trigger picks, a force of `force_n` acts at the main body's centre of "
              "mass, along `direction` in the world (z up), whatever the vehicle's attitude. Each time that "
              "the force begins to act is one activation.",
          .parameters = {{.name = "force_n",
                          .unit = "N",
                          .min = 0.0,
                          .max = 1e4,
                          .doc = "magnitude of the force",
                          .example = 2.0,
                          .zero = 0.0,
                          .severity = Scale::kLinear},
                         {.name = "direction",
                          .unit = "1",
                          .kind = ParameterKind::kVector,
                          .min = -1e3,
                          .max = 1e3,
                          .doc = "direction of the force, in the world; its length does not matter",
                          .example = std::array{0.0, 1.0, 0.0}}},
          .kind = PlantKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<PlantModel> {
            return std::make_unique<Force>(setup.parameters);
          }}};
}

}  // namespace tiltproof::faults
