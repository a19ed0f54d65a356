#include "faults/direction.h"
#include "faults/fault_type.h"

namespace tiltproof::faults {
namespace {

class ComShift : public PlantModel {
 public:
  explicit ComShift(const SignalSetup& setup) {
    disturbance_.com_shift_m = AlongDirection(setup.parameters, setup.parameters.Number("shift_m"));
  }

  Disturbance Act(const StepContext& /*context*/) override { return disturbance_; }

 private:
  Disturbance disturbance_;
};

}  // namespace

FaultType PlantComShift() {
  return {.name = "plant.com_shift",
          .summary = "The centre of mass is elsewhere.",
          .semantics =
              "Models a load that is packed badly or slips, or a battery that was moved. In every step that "
              "the trigger picks, the centre of mass of the main body is shifted by `shift_m` along "
              "`direction`. The axes are those of the main body (x forward, y left, z up), so the shift "
              "turns with it. The inertia about the centre of mass stays the same. The pose of the main "
              "body, the velocity of its origin and its angular rates stay the same when the shift begins or "
              "ends. Each time that the shift begins is one activation.",
          .source =
              "Beard and McLain, Small Unmanned Aircraft, Princeton University Press, 2012, chapter 3 "
              "(equations of motion).",
          .parameters = {{.name = "shift_m",
                          .unit = "m",
                          .min = 0.0,
                          .max = 1.0,
                          .doc = "how far it is shifted",
                          .example = 0.02,
                          .zero = 0.0,
                          .severity = Scale::kLinear},
                         DirectionParameter("where to, in the main body's axes; its length does not matter",
                                            {1.0, 0.0, 0.0})},
          .kind = PlantKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<PlantModel> {
            return std::make_unique<ComShift>(setup);
          }}};
}

}  // namespace tiltproof::faults
