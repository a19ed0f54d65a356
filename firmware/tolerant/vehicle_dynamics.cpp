#include "firmware/tolerant/vehicle_dynamics.h"

#include <algorithm>

#include "firmware/trigonometry.h"

namespace tiltproof::firmware {
namespace {

constexpr float kModelStepLength_s = static_cast<float>(ToSeconds(kModelStepNs));
constexpr float kGravity_m_s2 = 9.81F;

// A thruster at its present angle, in B.
struct Tilted {
  Vector3 x, axis, z;  // of its frame: the hinge is along y, the thrust along z
};

Tilted Tilt(const ThrusterConstants& thruster, float alpha_rad) {
  const SineCosine alpha = ComputeSineCosine(alpha_rad);
  const float s = thruster.cant_sine;
  const float c = thruster.cant_cosine;
  return {.x = {alpha.cosine, s * alpha.sine, -c * alpha.sine},
          .axis = {0, c, s},
          .z = {alpha.sine, -s * alpha.cosine, c * alpha.cosine}};
}

// The thruster's inertia times a vector.
Vector3 TimesInertia(const ThrusterConstants& thruster, const Tilted& tilted, const Vector3& rate) {
  return (thruster.inertia_xx_kg_m2 * Dot(tilted.x, rate)) * tilted.x +
         (thruster.inertia_yy_kg_m2 * Dot(tilted.axis, rate)) * tilted.axis +
         (thruster.inertia_zz_kg_m2 * Dot(tilted.z, rate)) * tilted.z;
}

// factor * a a^T
Symmetric3 Dyad(float factor, const Vector3& a) {
  const Vector3 b = factor * a;
  return {b.x * a.x, b.y * a.y, b.z * a.z, b.x * a.y, b.x * a.z, b.y * a.z};
}

// R turned by the small angle `turn` (along the world's axes): Rodrigues' formula as series, exact in binary32
// up to 0.2 rad.
Vector3 Turned(const Vector3& axis, const Vector3& turn, float sine_factor, float cosine_factor) {
  const Vector3 once = Cross(turn, axis);
  return axis + sine_factor * once + cosine_factor * Cross(turn, once);
}
void Turn(Matrix3& rotation, const Vector3& turn_rad) {
  const float z = Dot(turn_rad, turn_rad);
  const float sine_factor = 1 - z * (1.0F / 6) * (1 - z * (1.0F / 20));
  const float cosine_factor = 0.5F - z * (1.0F / 24) * (1 - z * (1.0F / 30));
  rotation.x = Turned(rotation.x, turn_rad, sine_factor, cosine_factor);
  rotation.y = Turned(rotation.y, turn_rad, sine_factor, cosine_factor);
  rotation.z = Turned(rotation.z, turn_rad, sine_factor, cosine_factor);
}

void StopAtEnd(float angle_max_rad, float& angle_rad, float& rate_rad_s) {
  if (angle_rad > angle_max_rad) {
    angle_rad = angle_max_rad;
    rate_rad_s = std::min(rate_rad_s, 0.0F);
  } else if (angle_rad < -angle_max_rad) {
    angle_rad = -angle_max_rad;
    rate_rad_s = std::max(rate_rad_s, 0.0F);
  }
}

}  // namespace

MotionState ToMotion(const Sensors& sensors) {
  const auto [sr, cr] = ComputeSineCosine(sensors.roll_rad);
  const auto [sp, cp] = ComputeSineCosine(sensors.pitch_rad);
  const auto [sy, cy] = ComputeSineCosine(sensors.yaw_rad);
  MotionState state;
  state.R_WB = {.x = {cy * cp, sy * cp, -sp},
                .y = {cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr},
                .z = {cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr}};
  state.w_WB_rad_s = {sensors.wx_rad_s, sensors.wy_rad_s, sensors.wz_rad_s};
  const Vector3 p_BC_W = state.R_WB * kTiltrotorConstants.p_BC_m;
  state.p_WC_m = Vector3{sensors.x_m, sensors.y_m, sensors.z_m} + p_BC_W;
  state.v_WC_m_s = Vector3{sensors.vx_m_s, sensors.vy_m_s, sensors.vz_m_s} + Cross(state.w_WB_rad_s, p_BC_W);
  state.alpha_rad = {sensors.alpha_r_rad, sensors.alpha_l_rad};
  state.alpha_rad_s = {sensors.alpha_r_rad_s, sensors.alpha_l_rad_s};
  return state;
}

Sensors ToSensors(const MotionState& state) {
  const Matrix3& r = state.R_WB;
  const Vector3 p_BC_W = r * kTiltrotorConstants.p_BC_m;
  const Vector3 p = state.p_WC_m - p_BC_W;
  const Vector3 v = state.v_WC_m_s - Cross(state.w_WB_rad_s, p_BC_W);
  const float yaw_rad = ArcTangent(r.x.y, r.x.x);
  const auto [sy, cy] = ComputeSineCosine(yaw_rad);
  return {.x_m = p.x,
          .y_m = p.y,
          .z_m = p.z,
          .roll_rad = ArcTangent(r.y.z, r.z.z),
          .pitch_rad = ArcTangent(-r.x.z, r.x.x * cy + r.x.y * sy),
          .yaw_rad = yaw_rad,
          .alpha_r_rad = state.alpha_rad[0],
          .alpha_l_rad = state.alpha_rad[1],
          .vx_m_s = v.x,
          .vy_m_s = v.y,
          .vz_m_s = v.z,
          .wx_rad_s = state.w_WB_rad_s.x,
          .wy_rad_s = state.w_WB_rad_s.y,
          .wz_rad_s = state.w_WB_rad_s.z,
          .alpha_r_rad_s = state.alpha_rad_s[0],
          .alpha_l_rad_s = state.alpha_rad_s[1]};
}

void StepMotion(const VehicleConstants& vehicle, const Actuators& inputs, MotionState& state,
                const HeldHinges& held) {
  const std::array<float, 2> thrust_n = {std::clamp(inputs.f_r_n, 0.0F, vehicle.force_max_n),
                                         std::clamp(inputs.f_l_n, 0.0F, vehicle.force_max_n)};
  const std::array<float, 2> torque_nm = {
      std::clamp(inputs.tau_r_nm, -vehicle.torque_max_nm, vehicle.torque_max_nm),
      std::clamp(inputs.tau_l_nm, -vehicle.torque_max_nm, vehicle.torque_max_nm)};
  const Vector3 w = Transposed(state.R_WB, state.w_WB_rad_s);

  Vector3 force;                                 // in B
  Vector3 momentum = vehicle.inertia_kg_m2 * w;  // angular, about C
  Vector3 torque;
  Symmetric3 inertia = vehicle.inertia_kg_m2;
  std::array<float, 2> hinge_torque_nm{};  // Iyy (a . w' + alpha'')
  std::array<Vector3, 2> axes;
  for (unsigned i = 0; i < 2; ++i) {
    const ThrusterConstants& thruster = vehicle.thrusters[i];
    const Tilted tilted = Tilt(thruster, state.alpha_rad[i]);
    const Vector3 spin = TimesInertia(thruster, tilted, w);
    const Vector3 thrust = thrust_n[i] * tilted.z;
    axes[i] = tilted.axis;
    if (held[i]) {
      state.alpha_rad_s[i] = 0;
      inertia = inertia + Dyad(thruster.inertia_yy_kg_m2, tilted.axis);
    } else {
      hinge_torque_nm[i] = torque_nm[i] - Dot(tilted.axis, Cross(w, spin));
    }
    force = force + thrust;
    momentum = momentum + spin + (thruster.inertia_yy_kg_m2 * state.alpha_rad_s[i]) * tilted.axis;
    // I' w, the thruster's inertia turning with its hinge.
    const Vector3 turning = state.alpha_rad_s[i] * (Cross(tilted.axis, spin) -
                                                    TimesInertia(thruster, tilted, Cross(tilted.axis, w)));
    torque = torque + Cross(thruster.arm_m, thrust) + thruster.drag_ratio_m * thrust - turning -
             hinge_torque_nm[i] * tilted.axis;
    // Its inertia without that about the hinge, which hinge_torque_nm accounts for.
    inertia = inertia + Dyad(thruster.inertia_xx_kg_m2, tilted.x) + Dyad(thruster.inertia_zz_kg_m2, tilted.z);
  }
  const Vector3 w_dot = Solve(inertia, torque - Cross(w, momentum));

  for (unsigned i = 0; i < 2; ++i) {
    if (held[i]) continue;
    state.alpha_rad_s[i] += kModelStepLength_s * (hinge_torque_nm[i] / vehicle.thrusters[i].inertia_yy_kg_m2 -
                                                  Dot(axes[i], w_dot));
    state.alpha_rad[i] += kModelStepLength_s * state.alpha_rad_s[i];
    StopAtEnd(vehicle.angle_max_rad, state.alpha_rad[i], state.alpha_rad_s[i]);
  }
  state.v_WC_m_s = state.v_WC_m_s + kModelStepLength_s * ((1 / vehicle.mass_kg) * (state.R_WB * force) -
                                                          Vector3{0, 0, kGravity_m_s2});
  state.p_WC_m = state.p_WC_m + kModelStepLength_s * state.v_WC_m_s;
  state.w_WB_rad_s = state.w_WB_rad_s + kModelStepLength_s * (state.R_WB * w_dot);
  Turn(state.R_WB, kModelStepLength_s * state.w_WB_rad_s);
}

InputEffects ComputeInputEffects(const VehicleConstants& vehicle, const MotionState& state) {
  Symmetric3 inertia = vehicle.inertia_kg_m2;
  std::array<Tilted, 2> tilted;
  for (unsigned i = 0; i < 2; ++i) {
    const ThrusterConstants& thruster = vehicle.thrusters[i];
    tilted[i] = Tilt(thruster, state.alpha_rad[i]);
    inertia =
        inertia + Dyad(thruster.inertia_xx_kg_m2, tilted[i].x) + Dyad(thruster.inertia_zz_kg_m2, tilted[i].z);
  }
  InputEffects effects;
  for (unsigned i = 0; i < 2; ++i) {
    const ThrusterConstants& thruster = vehicle.thrusters[i];
    const Vector3 turn = Cross(thruster.arm_m, tilted[i].z) + thruster.drag_ratio_m * tilted[i].z;
    effects.thrust_lift_m_s2[i] = tilted[i].z.z / vehicle.mass_kg;
    effects.thrust_roll_rad_s2[i] = Solve(inertia, turn).x;
    effects.hinge_axes[i] = tilted[i].axis;
  }
  return effects;
}

}  // namespace tiltproof::firmware
