#include "harness/node/joystick_reference.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <stdexcept>

namespace tiltproof::harness {
namespace {

constexpr std::array<double JoystickAxes::*, 3> kSticks = {&JoystickAxes::vx, &JoystickAxes::vy,
                                                           &JoystickAxes::vz};

bool IsSize(double value) { return std::isfinite(value) && value >= 0.0; }

}  // namespace

double ApplyDeadZone(double value, double dead_zone) {
  if (!(std::abs(value) > dead_zone)) return 0.0;
  const double magnitude = (std::min(std::abs(value), 1.0) - dead_zone) / (1.0 - dead_zone);
  return std::copysign(magnitude, value);
}

JoystickReference::JoystickReference(const ReferencePoint& start, const JoystickLimits& limits)
    : limits_(limits), value_(start) {
  if (!IsSize(limits.speed_m_s_max) || !IsSize(limits.yaw_rate_rad_s_max) || !IsSize(limits.yaw_rad_max))
    throw std::invalid_argument("joystick limits: speed, yaw rate and yaw must be finite and not negative");
  if (!(limits.dead_zone >= 0.0 && limits.dead_zone < 1.0))
    throw std::invalid_argument("joystick limits: the dead zone must be at least 0 and below 1");
  for (std::size_t i = 0; i < 3; ++i) {
    const double position_m = start.position_m[i];
    if (!std::isfinite(position_m) || !std::isfinite(start.yaw_rad))
      throw std::invalid_argument("joystick: the start must be finite");
    if (!(limits.position_m_min[i] <= limits.position_m_max[i]))
      throw std::invalid_argument("joystick limits: the box's lower end lies above its upper end");
    limits_.position_m_min[i] = std::min(limits_.position_m_min[i], position_m);
    limits_.position_m_max[i] = std::max(limits_.position_m_max[i], position_m);
    value_.velocity_m_s[i] = 0.0;
  }
  limits_.yaw_rad_max = std::max(limits_.yaw_rad_max, std::abs(start.yaw_rad));
}

ReferencePoint JoystickReference::Step(const JoystickAxes& axes, TimeNs dt) {
  const double dt_s = ToSeconds(std::clamp<TimeNs>(dt, 0, kStepMax));
  for (std::size_t i = 0; i < 3; ++i) {
    const double velocity_m_s = ApplyDeadZone(axes.*kSticks[i], limits_.dead_zone) * limits_.speed_m_s_max;
    const double wanted_m = value_.position_m[i] + velocity_m_s * dt_s;
    const double reached_m = std::clamp(wanted_m, limits_.position_m_min[i], limits_.position_m_max[i]);
    value_.position_m[i] = reached_m;
    value_.velocity_m_s[i] = reached_m == wanted_m ? velocity_m_s : 0.0;
  }
  const double yaw_rate_rad_s = ApplyDeadZone(axes.yaw_rate, limits_.dead_zone) * limits_.yaw_rate_rad_s_max;
  value_.yaw_rad =
      std::clamp(value_.yaw_rad + yaw_rate_rad_s * dt_s, -limits_.yaw_rad_max, limits_.yaw_rad_max);
  return value_;
}

}  // namespace tiltproof::harness
