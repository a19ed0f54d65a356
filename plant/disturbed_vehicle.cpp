#include "plant/disturbed_vehicle.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace tiltproof::plant {

VehicleModel WithBodies(const VehicleModel& vehicle, const Disturbance& disturbance) {
  VehicleModel with = vehicle;
  const auto scale = [&disturbance](RigidBody& body) {
    body.mass_kg *= disturbance.mass_factor;
    body.inertia_kg_m2 *= disturbance.inertia_factor;
  };
  scale(with.base);
  for (Hinge& hinge : with.hinges) scale(hinge.body);
  const Disturbance::Vector& shift = disturbance.com_shift_m;
  with.base.p_com_m += Eigen::Vector3d(shift[0], shift[1], shift[2]);
  return with;
}

Eigen::Vector3d DragForce(const BodyDrag& drag, const Eigen::Vector3d& v_m_s) {
  return -(drag.linear_n_s_m + drag.quadratic_n_s2_m2 * v_m_s.norm()) * v_m_s;
}

namespace {

// Not finite when a number of it is not. Each axis has a sum of its own, because additions that wait for one another take
// longer than all others here.
double SumOf(const Disturbance& disturbance) {
  std::array<double, 3> axes{};
  for (std::size_t i = 0; i < axes.size(); ++i)
    axes[i] = disturbance.force_n[i] + disturbance.torque_nm[i] + disturbance.torque_body_nm[i] +
              disturbance.wind_m_s[i] + disturbance.com_shift_m[i];
  double thrusts = 0, hinges = 0;
  for (std::size_t i = 0; i < kRotorsMax; ++i) {
    thrusts += disturbance.thrust_factor[i];
    hinges += disturbance.hinges[i].rate_rad_s;
  }
  return axes[0] + axes[1] + axes[2] + thrusts + hinges;
}

}  // namespace

std::string_view DisturbanceProblem(const Disturbance& disturbance) {
  const auto finite = [](const auto& values) {
    return std::all_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); });
  };
  const auto positive = [](double factor) { return std::isfinite(factor) && factor > 0; };
  if (!positive(disturbance.mass_factor) || !positive(disturbance.inertia_factor))
    return "a disturbance's factor of mass or inertia is not positive";
  if (std::isfinite(SumOf(disturbance))) return {};
  // Large numbers have a sum that is not finite, too.
  const bool rates =
      std::all_of(disturbance.hinges.begin(), disturbance.hinges.end(),
                  [](const Disturbance::Hinge& hinge) { return std::isfinite(hinge.rate_rad_s); });
  if (finite(disturbance.force_n) && finite(disturbance.torque_nm) && finite(disturbance.torque_body_nm) &&
      finite(disturbance.wind_m_s) && finite(disturbance.com_shift_m) && finite(disturbance.thrust_factor) &&
      rates)
    return {};
  return "a disturbance is not a number";
}

}  // namespace tiltproof::plant
