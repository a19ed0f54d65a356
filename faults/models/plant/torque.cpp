#include "faults/fault_type.h"

namespace tiltproof::faults {
namespace {

class Torque : public PlantModel {
 public:
  explicit Torque(const SignalSetup& setup) {
    const std::string& axis = setup.parameters.Choice("axis");
    disturbance_.torque_body_nm[axis == "x" ? 0 : axis == "y" ? 1 : 2] = setup.parameters.Number("torque_nm");
  }

  Disturbance Act(const StepContext& /*context*/) override { return disturbance_; }

 private:
  Disturbance disturbance_;
};

}  // namespace

FaultType PlantTorque() {
  return {
      .name = "plant.torque",
      .summary = "Twists the vehicle.",
      .semantics =
          "Models a twist that no actuator gives: a swinging load, a bent blade, a hand. In every step that "
          "the trigger picks, a torque of `torque_nm` acts on the main body about `axis`, right-handed, "
          "whatever the attitude: the axis turns with the body. A negative torque turns the other way. Each "
          "time that the torque begins to act is one activation.",
      .source =
          "Etkin, Dynamics of Atmospheric Flight, Wiley, 1972 (external moments in the equations of motion).",
      .parameters = {{.name = "torque_nm",
                      .unit = "N m",
                      .min = -1e3,
                      .max = 1e3,
                      .doc = "the torque",
                      .example = 0.1,
                      .zero = 0.0,
                      .severity = Scale::kLinear},
                     {.name = "axis",
                      .unit = "",
                      .kind = ParameterKind::kChoice,
                      .doc = "axis of the main body: x forward, y left, z up",
                      .example = "x",
                      .choices = {"x", "y", "z"}}},
      .kind = PlantKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<PlantModel> {
        return std::make_unique<Torque>(setup);
      }}};
}

}  // namespace tiltproof::faults
