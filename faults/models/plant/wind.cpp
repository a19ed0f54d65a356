#include "faults/direction.h"
#include "faults/fault_type.h"

namespace tiltproof::faults {
namespace {

class Wind : public PlantModel {
 public:
  explicit Wind(const SignalSetup& setup) {
    disturbance_.wind_m_s = AlongDirection(setup.parameters, setup.parameters.Number("speed_m_s"));
  }

  Disturbance Act(const StepContext& /*context*/) override { return disturbance_; }

 private:
  Disturbance disturbance_;
};

}  // namespace

FaultType PlantWind() {
  return {
      .name = "plant.wind",
      .summary = "Steady wind.",
      .semantics =
          "Models wind that blows evenly. In every step that the trigger picks, the air moves with "
          "`speed_m_s` along `direction` in the world (z up), everywhere alike, and at once from the first "
          "step on. The vehicle's drag turns the velocity relative to the air into a force on the main body; "
          "a scenario whose vehicle has no <tiltproof:drag> is refused (`model: tiltrotor_drag` has it). "
          "Winds "
          "of several faults add up. Each time that the wind begins to blow is one activation.",
      .source =
          "MIL-F-8785C, section 3.7 (steady wind); Beard and McLain, Small Unmanned Aircraft, Princeton "
          "University Press, 2012, chapter 4.",
      .parameters = {{.name = "speed_m_s",
                      .unit = "m/s",
                      .min = 0.0,
                      .max = 200.0,
                      .doc = "speed of the air",
                      .example = 5.0,
                      .zero = 0.0,
                      .severity = Scale::kLinear},
                     DirectionParameter("where the wind blows to, in the world; its length does not matter",
                                        {0.0, 1.0, 0.0})},
      .kind = PlantKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<PlantModel> {
                          return std::make_unique<Wind>(setup);
                        },
                        .is_wind = true}};
}

}  // namespace tiltproof::faults
