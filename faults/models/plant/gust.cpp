#include <algorithm>
#include <cmath>
#include <numbers>

#include "faults/active_time.h"
#include "faults/direction.h"
#include "faults/fault_type.h"

namespace tiltproof::faults {
namespace {

class Gust : public PlantModel {
 public:
  explicit Gust(const SignalSetup& setup)
      : speed_m_s_(setup.parameters.Number("speed_m_s")),
        length_m_(setup.parameters.Number("length_m")),
        full_m_s_(AlongDirection(setup.parameters, speed_m_s_)) {}

  Disturbance Act(const StepContext& context) override {
    const double distance_m = speed_m_s_ * ToSeconds(time_.At(context).value_or(0));
    const double part = std::min(distance_m / length_m_, 1.0);
    const double rise = 0.5 * (1.0 - std::cos(std::numbers::pi * part));
    Disturbance disturbance;
    for (std::size_t i = 0; i < full_m_s_.size(); ++i) disturbance.wind_m_s[i] = rise * full_m_s_[i];
    return disturbance;
  }
  void Pass(const StepContext& context) override { time_.At(context); }

 private:
  double speed_m_s_, length_m_;
  std::array<double, 3> full_m_s_;
  ActiveTime time_;
};

}  // namespace

FaultType PlantGust() {
  return {
      .name = "plant.gust",
      .summary = "A single gust.",
      .semantics =
          "Models the discrete gust of MIL-F-8785C. The speed of the air along `direction` in the world (z "
          "up) rises from 0 to `speed_m_s` as half a period of 1 - cosine over `length_m`. At the distance d "
          "from the gust's front it is `speed_m_s` / 2 (1 - cos(pi d / `length_m`)). Beyond `length_m` it is "
          "`speed_m_s`, until the window ends. The front meets the vehicle at the first step in the window "
          "and passes it with `speed_m_s`, whatever the vehicle's own velocity, so that the rise takes "
          "`length_m` / `speed_m_s` seconds. It starts again after each step outside the fault's active "
          "time. When the window ends, the air is calm at once. A scenario whose vehicle has no "
          "<tiltproof:drag> is refused (`model: tiltrotor_drag` has it). Each time that the gust begins is "
          "one activation.",
      .source = "MIL-F-8785C, section 3.7.1.3 (discrete gust model), 1980.",
      .parameters = {{.name = "speed_m_s",
                      .unit = "m/s",
                      .min = 0.0,
                      .max = 200.0,
                      .doc = "speed of the air when the gust has risen",
                      .example = 5.0,
                      .zero = 0.0,
                      .severity = Scale::kLinear},
                     DirectionParameter("where the gust blows to, in the world; its length does not matter",
                                        {0.0, 1.0, 0.0}),
                     {.name = "length_m",
                      .unit = "m",
                      .min = 0.01,
                      .max = 10'000.0,
                      .doc = "length over which the gust rises",
                      .example = 10.0}},
      .kind = PlantKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<PlantModel> {
                          return std::make_unique<Gust>(setup);
                        },
                        .is_wind = true}};
}

}  // namespace tiltproof::faults
