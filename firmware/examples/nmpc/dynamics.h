// Equations of motion of a rotorcraft and their derivatives, for the prediction of the controller.
//
//   Dynamics<2, 2> dynamics(vehicle);                    // two hinges, two rotors
//   const Linearised<2, 2> at = dynamics.Linearise(x, u, disturbance);
//   // at.rate is the derivative of x by time; at.a and at.b are its own by x and by u.
//
//   x  p (3, m), roll pitch yaw (Z-Y-X, rad), alpha of each hinge (rad),
//      v (3, m/s, world), w (3, rad/s, about B's axes), alpha' of each hinge (rad/s)
//   u  thrust of each rotor (N), torque of each hinge's servo (N m)
//
// By the principle of virtual power with the quasi-velocities (v in B, w, alpha'): M(alpha) a = W(alpha) u - h(alpha, w,
// alpha'). Gravity belongs to the acceleration of the main body, so the attitude acts only where the acceleration is
// turned into the world. The derivatives of the inverse dynamics are those of forward-mode differentiation; all others
// are formulas. Singular at pitch +/-90 degrees. Lag of rotors, stops and drag of the air are left out.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <unsupported/Eigen/AutoDiff>

#include "firmware/examples/nmpc/rotorcraft.h"

namespace tiltproof::nmpc {

inline constexpr double kGravity_m_s2 = 9.81;

template <int kHinges, int kRotors>
struct Sizes {
  static constexpr int kStates = 12 + 2 * kHinges, kInputs = kRotors + kHinges;
  static constexpr int kCoordinates = 6 + kHinges;  // and velocities
  using State = Eigen::Matrix<double, kStates, 1>;
  using Input = Eigen::Matrix<double, kInputs, 1>;
  using A = Eigen::Matrix<double, kStates, kStates>;
  using B = Eigen::Matrix<double, kStates, kInputs>;
};

// Accelerations that the model does not explain, added to it: of v (world) and of w (B).
struct Disturbance {
  Eigen::Vector3d linear_m_s2 = Eigen::Vector3d::Zero();
  Eigen::Vector3d angular_rad_s2 = Eigen::Vector3d::Zero();
};

template <int kHinges, int kRotors>
struct Linearised {
  typename Sizes<kHinges, kRotors>::State rate;
  typename Sizes<kHinges, kRotors>::A a;
  typename Sizes<kHinges, kRotors>::B b;
};

// The state after a time, and its derivatives with respect to the state before and the constant input.
template <int kHinges, int kRotors>
struct Interval {
  typename Sizes<kHinges, kRotors>::State end;
  typename Sizes<kHinges, kRotors>::A a;
  typename Sizes<kHinges, kRotors>::B b;
};

template <int kHinges, int kRotors>
class Dynamics {
 public:
  using Size = Sizes<kHinges, kRotors>;
  using State = typename Size::State;
  using Input = typename Size::Input;

  explicit Dynamics(const Rotorcraft& vehicle) : vehicle_(vehicle) {}

  State Rate(const State& x, const Input& u, const Disturbance& disturbance) const;
  Linearised<kHinges, kRotors> Linearise(const State& x, const Input& u,
                                         const Disturbance& disturbance) const;

  // One step of the classical Runge-Kutta method, as the derivatives are.
  State Advance(const State& x, const Input& u, const Disturbance& disturbance, double time_s) const;
  Interval<kHinges, kRotors> AdvanceLinearised(const State& x, const Input& u, const Disturbance& disturbance,
                                               double time_s) const;

 private:
  static constexpr int kN = Size::kCoordinates, kMoving = 2 * kHinges + 3;  // alpha, w, alpha'
  using Velocities = Eigen::Matrix<double, kN, 1>;
  using Mass = Eigen::Matrix<double, kN, kN>;
  using Map = Eigen::Matrix<double, kN, Size::kInputs>;
  using Slopes = Eigen::Matrix<double, kN, kMoving + Size::kInputs>;
  template <class Scalar>
  using Vector3 = Eigen::Matrix<Scalar, 3, 1>;
  template <class Scalar>
  using Forces = Eigen::Matrix<Scalar, kN, 1>;

  // Torques and forces that the motion needs: M a + h, for the acceleration `a` of the quasi-velocities, whose first
  // three include gravity.
  template <class Scalar>
  Forces<Scalar> Inverse(const Eigen::Matrix<Scalar, kMoving, 1>& moving, const Velocities& a) const;
  Mass MassAt(const State& x) const;
  // W of W u.
  Map InputMap(const State& x) const;
  // Adds the derivatives of W u with respect to the hinges' angles.
  void AddTurningThrusts(const State& x, const Input& u, const Map& map, Slopes& sides) const;
  static Eigen::Matrix<double, kMoving, 1> MovingOf(const State& x) {
    Eigen::Matrix<double, kMoving, 1> moving;
    moving << x.template segment<kHinges>(6), x.template segment<3>(9 + kHinges), x.template tail<kHinges>();
    return moving;
  }

  Rotorcraft vehicle_;
};

// The vehicles for which dynamics.cpp has the code.
extern template class Dynamics<2, 2>;
extern template class Dynamics<0, 4>;

}  // namespace tiltproof::nmpc
