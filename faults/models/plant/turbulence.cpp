#include <algorithm>
#include <cmath>
#include <optional>

#include "faults/fault_type.h"

namespace tiltproof::faults {
namespace {

constexpr double kMetresPerFoot = 0.3048;

// White noise through the filter 1 / (1 + T s), of variance 1. Sampled exactly: the time between two values may
// be any.
class LongitudinalFilter {
 public:
  explicit LongitudinalFilter(double time_constant_s) : time_constant_s_(time_constant_s) {}
  double Start(Random& random) { return x_ = random.StandardNormal(); }
  double Next(double step_s, Random& random) {
    const double decay = std::exp(-step_s / time_constant_s_);
    return x_ = decay * x_ + std::sqrt(1 - decay * decay) * random.StandardNormal();
  }

 private:
  double time_constant_s_, x_ = 0;
};

// The same through (1 + sqrt(3) T s) / (1 + T s)^2, which is sqrt(3) / (1 + T s) + (1 - sqrt(3)) / (1 + T s)^2.
// x is the first of these two poles' outputs, of variance 1; y follows it through the second, and has the
// variance 1/2 and the covariance 1/2 with x. The sum has the variance 2.
class TransverseFilter {
 public:
  explicit TransverseFilter(double time_constant_s) : time_constant_s_(time_constant_s) {}
  double Start(Random& random) {
    x_ = random.StandardNormal();
    y_ = 0.5 * x_ + 0.5 * random.StandardNormal();
    return Value();
  }
  double Next(double step_s, Random& random) {
    const double r = step_s / time_constant_s_;
    const double decay = std::exp(-r), squared = decay * decay;
    // The covariance that a step adds to what is left of the old one, and its Cholesky factor.
    const double xx = 1 - squared, xy = 0.5 - squared * (r + 0.5), yy = 0.5 - squared * (r * r + r + 0.5);
    const double a = std::sqrt(xx), b = xy / a, c = std::sqrt(std::max(0.0, yy - b * b));
    const double first = random.StandardNormal(), second = random.StandardNormal();
    y_ = decay * (y_ + r * x_) + b * first + c * second;
    x_ = decay * x_ + a * first;
    return Value();
  }

 private:
  double Value() const { return (std::sqrt(3.0) * x_ + (1 - std::sqrt(3.0)) * y_) / std::sqrt(2.0); }
  double time_constant_s_, x_ = 0, y_ = 0;
};

// The low-altitude model: lengths and standard deviations at a height (MIL-HDBK-1797, where 2 Lw is the height).
struct Scales {
  double longitudinal_m, lateral_m, vertical_m;
  double horizontal_per_vertical;  // ratio of the standard deviations
};
Scales ScalesAt(double height_m) {
  const double height_ft = height_m / kMetresPerFoot;
  const double base = 0.177 + 0.000823 * height_ft;
  const double longitudinal_m = height_m / std::pow(base, 1.2);
  return {longitudinal_m, longitudinal_m / 2, height_m / 2, 1 / std::pow(base, 0.4)};
}

class Turbulence : public PlantModel {
 public:
  explicit Turbulence(const SignalSetup& setup)
      : vertical_m_s_(setup.parameters.Number("intensity_m_s")),
        scales_(ScalesAt(setup.parameters.Number("height_m"))),
        u_(scales_.longitudinal_m / setup.parameters.Number("reference_speed_m_s")),
        v_(2 * scales_.lateral_m / setup.parameters.Number("reference_speed_m_s")),
        w_(2 * scales_.vertical_m / setup.parameters.Number("reference_speed_m_s")) {}

  Disturbance Act(const StepContext& context) override {
    const double horizontal_m_s = vertical_m_s_ * scales_.horizontal_per_vertical;
    Random& random = context.random;
    double u = 0, v = 0, w = 0;
    if (last_ns_) {
      const double step_s = ToSeconds(context.time_ns - *last_ns_);
      u = u_.Next(step_s, random);
      v = v_.Next(step_s, random);
      w = w_.Next(step_s, random);
    } else {
      u = u_.Start(random);
      v = v_.Start(random);
      w = w_.Start(random);
    }
    last_ns_ = context.time_ns;
    Disturbance disturbance;
    disturbance.wind_m_s = {horizontal_m_s * u, horizontal_m_s * v, vertical_m_s_ * w};
    return disturbance;
  }

 private:
  double vertical_m_s_;
  Scales scales_;
  LongitudinalFilter u_;
  TransverseFilter v_, w_;
  std::optional<TimeNs> last_ns_;  // the last step in which it blew
};

}  // namespace

FaultType PlantTurbulence() {
  return {.name = "plant.turbulence",
          .summary = "Turbulent air.",
          .semantics =
              "Models the Dryden turbulence of MIL-HDBK-1797 at low altitude. In every step that the trigger "
              "picks, the air moves with a random velocity (u, v, w) along x, y and z of the world, "
              "everywhere alike. Each part is normally distributed with mean 0; they are independent of each "
              "other. The standard deviation of w is `intensity_m_s`, and that of u and v is `intensity_m_s` "
              "/ (0.177 + 0.000823 h)^0.4, where h is `height_m` in feet. Their one-sided spectra over the "
              "angular frequency f have the variance S. The spectrum of u is S (2 L / (pi V)) / (1 + (L f / "
              "V)^2). Those of v and w are S (2 L / (pi V)) (1 + 12 (L f / V)^2) / (1 + 4 (L f / V)^2)^2. "
              "The lengths L are Lu = `height_m` / (0.177 + 0.000823 h)^1.2, Lv = Lu / 2 and Lw = `height_m` "
              "/ 2. V is `reference_speed_m_s`, with which the frozen field passes the vehicle; it is used "
              "in flight and at hover alike, because a hovering vehicle has no airspeed of its own. "
              "`height_m` is that of the model: it does not follow the vehicle. The process is sampled "
              "exactly at the steps, so that its statistics do not depend on the step, and is stationary "
              "from the first step on. In a pause (of an intermittent fault) the process goes on unseen. A "
              "scenario whose vehicle has no <tiltproof:drag> is refused (`model: tiltrotor_drag` has it). "
              "Each time that the air begins to move is one activation.",
          .source =
              "MIL-HDBK-1797, Appendix A, Dryden form and low-altitude model, 1997; Beal, Digital Simulation "
              "of Atmospheric Turbulence for Dryden and von Karman Models, Journal of Guidance, Control, and "
              "Dynamics 16(1), 1993.",
          .parameters = {{.name = "intensity_m_s",
                          .unit = "m/s",
                          .min = 0.0,
                          .max = 100.0,
                          .doc = "standard deviation of the vertical wind",
                          .example = 1.0,
                          .zero = 0.0,
                          .severity = Scale::kLogarithmic},
                         {.name = "model",
                          .unit = "",
                          .kind = ParameterKind::kChoice,
                          .doc = "form of the spectra",
                          .example = "dryden",
                          .default_value = "dryden",
                          .choices = {"dryden"}},
                         {.name = "reference_speed_m_s",
                          .unit = "m/s",
                          .min = 1.0,
                          .max = 300.0,
                          .doc = "speed with which the turbulent air passes the vehicle",
                          .example = 5.0,
                          .default_value = 5.0},
                         {.name = "height_m",
                          .unit = "m",
                          .min = 3.048,
                          .max = 304.8,
                          .doc = "height above ground whose turbulence it is",
                          .example = 10.0,
                          .default_value = 10.0}},
          .kind = PlantKind{.make = [](const SignalSetup& setup) -> std::unique_ptr<PlantModel> {
                              return std::make_unique<Turbulence>(setup);
                            },
                            .is_wind = true}};
}

}  // namespace tiltproof::faults
