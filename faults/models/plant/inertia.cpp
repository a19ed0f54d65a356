#include "faults/fault_type.h"

namespace tiltproof::faults {
namespace {

class Inertia : public PlantModel {
 public:
  explicit Inertia(const SignalSetup& setup) {
    disturbance_.inertia_factor = setup.parameters.Number("factor");
  }

  Disturbance Act(const StepContext& /*context*/) override { return disturbance_; }

 private:
  Disturbance disturbance_;
};

}  // namespace

FaultType PlantInertia() {
  return {.name = "plant.inertia",
          .summary = "The vehicle turns more slowly, or more easily.",
          .semantics =
              "Models masses that are further out, or further in, than the design says. In every step that "
              "the trigger picks, the inertia of each of the vehicle's bodies about its own centre of mass "
              "is multiplied by `factor`. Masses and places stay the same, and so do velocities and angular "
              "rates. Each time that the inertia changes from its own value is one activation.",
          .source =
              "Beard and McLain, Small Unmanned Aircraft, Princeton University Press, 2012, chapter 3 "
              "(equations of motion).",
          .parameters = {{.name = "factor",
                          .unit = "1",
                          .min = 0.1,
                          .max = 10.0,
                          .doc = "what each inertia is multiplied by",
                          .example = 2.0,
                          .zero = 1.0,
                          .severity = Scale::kLogarithmic}},
          .kind = PlantKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<PlantModel> {
            return std::make_unique<Inertia>(setup);
          }}};
}

}  // namespace tiltproof::faults
