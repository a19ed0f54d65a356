#include "faults/fault_type.h"

namespace tiltproof::faults {
namespace {

class Mass : public PlantModel {
 public:
  explicit Mass(const SignalSetup& setup) { disturbance_.mass_factor = setup.parameters.Number("factor"); }

  Disturbance Act(const StepContext& /*context*/) override { return disturbance_; }

 private:
  Disturbance disturbance_;
};

}  // namespace

FaultType PlantMass() {
  return {
      .name = "plant.mass",
      .summary = "The vehicle is heavier or lighter.",
      .semantics =
          "Models a load that is taken up or dropped, or a wrong estimate of the mass. In every step that "
          "the trigger picks, the mass of each of the vehicle's bodies is multiplied by `factor`. Their "
          "inertias about their own centres of mass stay the same, and so do their velocities: when the mass "
          "changes, momentum comes or goes with what is added or dropped. The hover input that holds before "
          "the first command is that of the vehicle as it is in its file. Each time that the mass changes "
          "from its own value is one activation.",
      .source =
          "Beard and McLain, Small Unmanned Aircraft, Princeton University Press, 2012, chapter 3 (equations "
          "of motion); Ducard, Fault-tolerant Flight Control and Guidance Systems, Springer, 2009.",
      .parameters = {{.name = "factor",
                      .unit = "1",
                      .min = 0.1,
                      .max = 10.0,
                      .doc = "what each mass is multiplied by",
                      .example = 1.2,
                      .zero = 1.0,
                      .severity = Scale::kLogarithmic}},
      .kind = PlantKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<PlantModel> {
        return std::make_unique<Mass>(setup);
      }}};
}

}  // namespace tiltproof::faults
