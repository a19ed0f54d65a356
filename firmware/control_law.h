// Activity 2 of 4: the discrete linear-quadratic regulator with integral action (paper, section 3; Rego and
// Raffo, 2016).
//
//   u(k) = u_eq - K (x(k) - x_ref(k))
//
//   x     = q (8), q_dot (8), integrals of the errors of x, y, z and yaw (4)
//   q     = x y z roll pitch yaw alpha_r alpha_l
//   x_ref = (x y z 0 0 yaw 0 0   vx vy vz 0 0 0 0 0   0 0 0 0)
//
// SI units, angles in rad, one step every 12 ms. The integrals follow the trapezoidal rule and include the
// present error; the error before the first step counts as zero. The law is linear and nothing else: no
// saturation, no wrapping of the yaw error (sensed yaw is in (-pi, pi]). A value that is not finite in any
// input gives outputs that are not finite from then on, because the integrals keep it.
//
// Arithmetic is binary32, in a fixed order, so that every port computes the same bits.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "firmware/signals.h"
#include "link/time.h"

namespace tiltproof::firmware {

// The paper's (section 2): one request for sensors every 12 ms of the firmware's own clock.
inline constexpr TimeNs kControlPeriodNs = 12 * kNsPerMs;

inline constexpr std::size_t kIntegralCount = 4;
inline constexpr std::size_t kStateCount = kSensorCount + kIntegralCount;

// Integrals of the errors of x, y, z (m s) and yaw (rad s).
using Integrals = std::array<float, kIntegralCount>;

// K: rows f_r (N), f_l (N), tau_r (N m), tau_l (N m); columns in the order of x above.
using Gain = std::array<std::array<float, kStateCount>, kActuatorCount>;

// kFrozen: the integrals stay as they are in this step.
enum class Integration : std::uint8_t { kOn, kFrozen };

class ControlLaw {
 public:
  // `gain` must outlive the law; `feed_forward` is u_eq, the inputs of hover.
  ControlLaw(const Gain& gain, const Actuators& feed_forward);

  Actuators Step(const Sensors& sensors, const Reference& reference,
                 Integration integration = Integration::kOn);

  const Integrals& integrals() const { return integrals_; }
  void SetIntegrals(const Integrals& integrals) { integrals_ = integrals; }

 private:
  const Gain& gain_;
  Actuators feed_forward_;
  Integrals integrals_{};
  std::array<float, kIntegralCount> previous_errors_{};  // of the last step
};

}  // namespace tiltproof::firmware
