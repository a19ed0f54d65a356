// The tilt-rotor in thirty lines of equations, for closing the loop without the real plant (no ODE, no SDF):
// one rigid body with two weightless thrusters on hinges, whose servos feel their own inertia only.
// Gyroscopic terms and products of inertia are left out.
//
// Numbers: masses, hinges and inertias of the design vehicle (paper, Table 1), summed up about its centre of
// mass. SI units.
#pragma once

#include <cmath>

#include "firmware/signals.h"

namespace tiltproof::firmware {

class SimpleVehicle {
 public:
  SimpleVehicle(double x_m, double y_m, double z_m) {
    state_.x_m = x_m;
    state_.y_m = y_m;
    state_.z_m = z_m;
    state_.pitch_rad = -0.0117;
    state_.alpha_r_rad = state_.alpha_l_rad = 0.0116;
  }

  const SensorsTruth& state() const { return state_; }

  // Adds that velocity along x and y at once.
  void Push(double velocity_m_s) {
    state_.vx_m_s += velocity_m_s;
    state_.vy_m_s += velocity_m_s;
  }

  // Semi-implicit Euler; steps of 1 ms keep the servos (the fastest part) accurate to a few per cent.
  void Step(const ActuatorsTruth& u, double step_s) {
    SensorsTruth& s = state_;
    const double sin_beta = std::sin(kBeta_rad);
    const double cos_beta = std::cos(kBeta_rad);
    const Vector force_r = Scale(
        {std::sin(s.alpha_r_rad), std::cos(s.alpha_r_rad) * sin_beta, std::cos(s.alpha_r_rad) * cos_beta},
        u.f_r_n);
    const Vector force_l = Scale(
        {std::sin(s.alpha_l_rad), -std::cos(s.alpha_l_rad) * sin_beta, std::cos(s.alpha_l_rad) * cos_beta},
        u.f_l_n);
    const Vector arm_r = {0.00237, -0.27774, 0.06863};  // from the centre of mass
    const Vector arm_l = {0.00237, 0.27748, 0.06863};
    Vector moment = Add(Cross(arm_r, force_r), Cross(arm_l, force_l));
    moment = Add(moment, Add(Scale(force_r, kDrag_m), Scale(force_l, -kDrag_m)));
    moment.y -= u.tau_r_nm + u.tau_l_nm;

    // Body axes in the world, Z-Y-X.
    const Vector thrust = ToWorld(Add(force_r, force_l));
    const Vector turn = ToWorld({moment.x / 0.0837, moment.y / 0.0101, moment.z / 0.0791});
    s.vx_m_s += step_s * thrust.x / kMass_kg;
    s.vy_m_s += step_s * thrust.y / kMass_kg;
    s.vz_m_s += step_s * (thrust.z / kMass_kg - 9.81);
    s.wx_rad_s += step_s * turn.x;
    s.wy_rad_s += step_s * turn.y;
    s.wz_rad_s += step_s * turn.z;
    const double pitch_acceleration = moment.y / 0.0101;
    s.alpha_r_rad_s += step_s * (u.tau_r_nm / 1.0486e-4 - pitch_acceleration);
    s.alpha_l_rad_s += step_s * (u.tau_l_nm / 1.0486e-4 - pitch_acceleration);

    s.x_m += step_s * s.vx_m_s;
    s.y_m += step_s * s.vy_m_s;
    s.z_m += step_s * s.vz_m_s;
    const double along = std::cos(s.yaw_rad) * s.wx_rad_s + std::sin(s.yaw_rad) * s.wy_rad_s;
    const double across = -std::sin(s.yaw_rad) * s.wx_rad_s + std::cos(s.yaw_rad) * s.wy_rad_s;
    s.roll_rad += step_s * along / std::cos(s.pitch_rad);
    s.pitch_rad += step_s * across;
    s.yaw_rad += step_s * (s.wz_rad_s + along * std::tan(s.pitch_rad));
    s.alpha_r_rad += step_s * s.alpha_r_rad_s;
    s.alpha_l_rad += step_s * s.alpha_l_rad_s;
  }

 private:
  struct Vector {
    double x, y, z;
  };
  static constexpr double kMass_kg = 2.08699;
  static constexpr double kBeta_rad = 0.0872665;
  static constexpr double kDrag_m = 0.0178947;

  static Vector Add(Vector a, Vector b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
  static Vector Scale(Vector a, double factor) { return {a.x * factor, a.y * factor, a.z * factor}; }
  static Vector Cross(Vector a, Vector b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
  }
  Vector ToWorld(Vector a) const {
    const double cr = std::cos(state_.roll_rad), sr = std::sin(state_.roll_rad);
    const double cp = std::cos(state_.pitch_rad), sp = std::sin(state_.pitch_rad);
    const double cy = std::cos(state_.yaw_rad), sy = std::sin(state_.yaw_rad);
    const Vector rolled = {a.x, cr * a.y - sr * a.z, sr * a.y + cr * a.z};
    const Vector pitched = {cp * rolled.x + sp * rolled.z, rolled.y, -sp * rolled.x + cp * rolled.z};
    return {cy * pitched.x - sy * pitched.y, sy * pitched.x + cy * pitched.y, pitched.z};
  }

  SensorsTruth state_;
};

}  // namespace tiltproof::firmware
