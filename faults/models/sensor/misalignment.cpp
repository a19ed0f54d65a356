#include <array>
#include <cmath>

#include "faults/fault_type.h"
#include "faults/signal_choice.h"

namespace tiltproof::faults {
namespace {

constexpr double kHalfTurn_rad = 3.141592653589793;

// Turned about axis a, the components along the next two axes, b and c, mix.
class MisalignedSensors : public SensorModel {
 public:
  explicit MisalignedSensors(const SignalSetup& setup) {
    const std::array<std::size_t, 3> xyz = SensorVectorIndices(setup);
    const std::string& axis = setup.parameters.Choice("axis");
    const std::size_t a = axis == "x" ? 0 : axis == "y" ? 1 : 2;
    b_ = xyz[(a + 1) % 3];
    c_ = xyz[(a + 2) % 3];
    const double angle_rad = setup.parameters.Number("angle_rad");
    cosine_ = std::cos(angle_rad);
    sine_ = std::sin(angle_rad);
  }

  void Act(std::span<double> values, const SampleContext& /*context*/) override {
    const auto b = values[b_], c = values[c_];
    values[b_] = cosine_ * b + sine_ * c;
    values[c_] = cosine_ * c - sine_ * b;
  }

 private:
  std::size_t b_, c_;
  double cosine_, sine_;
};

}  // namespace

FaultType SensorMisalignment() {
  return {
      .name = "sensor.misalignment",
      .summary = "Three sensors are mounted at an angle.",
      .semantics =
          "Models an inertial unit that is mounted crooked, or a tracking system whose axes are not the "
          "map's. The three signals are taken as one vector, along the axes in which the vehicle measures "
          "it. For a position or velocity these are the world's, for rates those that `angular_rates` in the "
          "scenario names for rates. In every sample that the trigger picks, they read the components of "
          "this vector along axes that are turned by `angle_rad` about `axis`, right-handed. About z: x "
          "reads x cos + y sin, and y reads y cos - x sin; about x the same holds for y and z, about y for z "
          "and x. The signal along `axis` is unchanged. The others are rounded to the 32 bits of the line.",
      .source =
          "IEEE Std 1431-2004 (misalignment); Titterton and Weston, Strapdown Inertial Navigation "
          "Technology, 2nd ed., IEE, 2004.",
      .parameters = {SensorVectorParameter(),
                     {.name = "axis",
                      .unit = "",
                      .kind = ParameterKind::kChoice,
                      .doc = "the axis about which the sensors are turned",
                      .example = "x",
                      .choices = {"x", "y", "z"}},
                     {.name = "angle_rad",
                      .unit = "rad",
                      .min = -kHalfTurn_rad,
                      .max = kHalfTurn_rad,
                      .doc = "how far they are turned",
                      .example = 0.1,
                      .zero = 0.0,
                      .severity = Scale::kLinear}},
      .kind = SensorKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<SensorModel> {
                           return std::make_unique<MisalignedSensors>(setup);
                         },
                         .on_vector = true}};
}

}  // namespace tiltproof::faults
