// The firmware's model of the vehicle's motion: what it will do in the next milliseconds under known inputs.
//
//   MotionState state = ToMotion(sensors);
//   for (int step = 0; step < 3; ++step) StepMotion(kTiltrotorConstants, inputs, state);  // 12 ms
//   const Sensors predicted = ToSensors(state);
//
// Rigid main body B and two thrusters on hinges, thrust and drag torque of the propellers, gravity; no air, no
// ground. About the vehicle's centre of mass C, which is fixed in B, with the body's rate w and the hinges'
// rates along their axes a_i, all in B:
//
//   m a_C = sum f_i z_i + m g
//   H     = J w + sum I_i a_i alpha_i'
//   J w' + sum Iyy_i a_i alpha_i''  =  sum (r_i x f_i z_i + k_i f_i z_i) - w x H - sum I_i' w
//   Iyy_i (a_i . w' + alpha_i'')    =  tau_i - a_i . (w x I_i w)
//
// (Newton and Euler; compare plant/dynamics.h, which derives them from Jacobians.) The last line gives
// alpha_i'', so that a step solves 3 equations only. Steps of 4 ms, semi-implicit, as the paper's plant
// (section 2.2): rates first, then positions with the new rates.
#pragma once

#include <array>

#include "firmware/signals.h"
#include "firmware/tolerant/vector3.h"
#include "firmware/tolerant/vehicle_parameters.h"
#include "link/time.h"

namespace tiltproof::firmware {

inline constexpr TimeNs kModelStepNs = 4 * kNsPerMs;

// World frame W.
struct MotionState {
  Vector3 p_WC_m;
  Matrix3 R_WB;
  std::array<float, 2> alpha_rad{};  // right, left
  Vector3 v_WC_m_s;
  Vector3 w_WB_rad_s;  // along the world's axes
  std::array<float, 2> alpha_rad_s{};
  friend bool operator==(const MotionState&, const MotionState&) = default;
};

// Angular rates of `sensors` along the world's axes.
MotionState ToMotion(const Sensors& sensors);
Sensors ToSensors(const MotionState& state);

// Hinges that do not turn, whatever the servo does: right, left.
using HeldHinges = std::array<bool, 2>;

// One step of kModelStepNs with the inputs saturated to the vehicle's limits.
void StepMotion(const VehicleConstants& vehicle, const Actuators& inputs, MotionState& state,
                const HeldHinges& held = {});

// Effect of a thrust of 1 N on the accelerations along the body's z and about its x, and the hinges' axes in B.
// About those only the servo's torque turns a thruster.
struct InputEffects {
  std::array<float, 2> thrust_lift_m_s2{};    // right, left
  std::array<float, 2> thrust_roll_rad_s2{};  // right, left
  std::array<Vector3, 2> hinge_axes;
};
InputEffects ComputeInputEffects(const VehicleConstants& vehicle, const MotionState& state);

}  // namespace tiltproof::firmware
