// Computes the reference that the base station sends from stick positions: magnitude and scale (paper,
// section 2.2), then the distance covered. Pure: the same sticks and steps give the same references.
//
//   JoystickReference reference(start, {.speed_m_s_max = 1.0});
//   ReferencePoint r = reference.Step(axes, period_ns);   // in every period
#pragma once

#include <array>

#include "harness/node/joystick_input.h"
#include "harness/reference/reference_point.h"
#include "link/time.h"

namespace tiltproof::harness {

// 0 within `dead_zone` of the centre (0 <= dead_zone < 1), the full way outside of it: continuous, odd, 1
// at 1. Values beyond -1..1 count as the end points, NaN as the centre.
double ApplyDeadZone(double value, double dead_zone);

struct JoystickLimits {
  double speed_m_s_max = 1.0;       // of each of vx, vy, vz at full deflection
  double yaw_rate_rad_s_max = 0.5;  // at full deflection
  double dead_zone = 0.05;          // of each axis
  // Where the reference may be, in the world frame; a start outside widens the box.
  std::array<double, 3> position_m_min = {-50.0, -50.0, 0.5};
  std::array<double, 3> position_m_max = {50.0, 50.0, 50.0};
  // Limit to both sides. It is less than pi, where the sensed yaw jumps and the control law does not wrap.
  double yaw_rad_max = 3.0;
};

class JoystickReference {
 public:
  // Limit of the time that a step covers: a base station that was delayed does not make the vehicle jump.
  static constexpr TimeNs kStepMax = 100 * kNsPerMs;

  // At rest at `start`. Throws std::invalid_argument for limits that are not finite, negative or reversed.
  JoystickReference(const ReferencePoint& start, const JoystickLimits& limits);

  // The reference after `dt` with the sticks in this position: the position is moved by the commanded
  // velocity, along the axes of the world frame, and has that velocity. At a wall of the box it stops, with
  // velocity 0 along that axis.
  ReferencePoint Step(const JoystickAxes& axes, TimeNs dt);

  const ReferencePoint& value() const { return value_; }

 private:
  JoystickLimits limits_;
  ReferencePoint value_;
};

}  // namespace tiltproof::harness
