#include <algorithm>

#include "faults/active_time.h"
#include "faults/fault_type.h"

namespace tiltproof::faults {
namespace {

class BatterySag : public PlantModel {
 public:
  explicit BatterySag(const SignalSetup& setup)
      : share_per_s_(setup.parameters.Number("share_per_s")), rotor_count_(setup.signals.rotors.size()) {}

  Disturbance Act(const StepContext& context) override {
    const double lost = share_per_s_ * ToSeconds(time_.At(context).value_or(0));
    Disturbance disturbance;
    std::fill_n(disturbance.thrust_factor.begin(), std::min(rotor_count_, kRotorsMax),
                std::max(1.0 - lost, 0.0));
    return disturbance;
  }
  void Pass(const StepContext& context) override { time_.At(context); }

 private:
  double share_per_s_;
  std::size_t rotor_count_;
  ActiveTime time_;
};

}  // namespace

FaultType PlantBatterySag() {
  return {
      .name = "plant.battery_sag",
      .summary = "The battery runs down: all rotors lose thrust together.",
      .semantics =
          "Models a battery whose voltage falls under load, so that all rotors give less and less thrust "
          "for the same command. In every step that the trigger picks, each rotor gives 1 - "
          "`share_per_s` t times the thrust in force, and as much of the drag torque that goes with it, "
          "but never less than nothing. Here t is the time since the first step in the fault's active "
          "time. It starts again after each step outside the active time. The input in the trace (f_r_n "
          "for the right rotor of the tilt-rotor) is the thrust in force before the factor. After the "
          "window, the thrust is whole at once. The first step still has the whole thrust; each time that "
          "the thrust begins to fall is one activation.",
      .source =
          "Tremblay and Dessaint, Experimental Validation of a Battery Dynamic Model for EV Applications, "
          "World Electric Vehicle Journal 3(2), 2009 (discharge curve, its linear part).",
      .parameters = {{.name = "share_per_s",
                      .unit = "1/s",
                      .min = 0.0,
                      .max = 10.0,
                      .doc = "share of the whole thrust that is lost in each second",
                      .example = 0.02,
                      .zero = 0.0,
                      .severity = Scale::kLogarithmic}},
      .kind = PlantKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<PlantModel> {
        return std::make_unique<BatterySag>(setup);
      }}};
}

}  // namespace tiltproof::faults
