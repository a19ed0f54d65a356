// Equations of motion of a vehicle in minimal coordinates: what the controller design linearises.
//
//   q = (x, y, z, roll, pitch, yaw, alpha_r, alpha_l)
//       position of the main body's frame origin (m), its Z-Y-X Euler angles (rad), hinge angles (rad)
//   u = (f_r, f_l, tau_r, tau_l)
//       thrusts (N), servo torques (N m)
//
// Derived with the principle of virtual power: with the Jacobians of every body's centre of mass velocity and
// angular velocity,
//   sum (m J_v^T a + J_w^T (I w' + w x I w)) = generalised forces,
//   a = J_v q'' + a_0,   w' = J_w q'' + w'_0.
// Without stops, ground and saturation. Singular at pitch +/-90 deg.
//
// Templated on the scalar (double, std::complex<double>): a complex step h gives derivatives without
// rounding, df/dx = Im f(x + ih) / h.
#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <array>
#include <cmath>
#include <complex>
#include <stdexcept>

#include "plant/vehicle_model.h"

namespace tiltproof::plant {

inline constexpr int kCoordinateCount = 8;
inline constexpr int kInputCount = 4;

template <class Scalar>
using Coordinates = Eigen::Matrix<Scalar, kCoordinateCount, 1>;
template <class Scalar>
using Inputs = Eigen::Matrix<Scalar, kInputCount, 1>;

// The vehicle has no hover, or a design on it has no answer.
struct DesignError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// M(q) q'' = force(q, q', u), force including gravity and the velocity-dependent terms.
template <class Scalar>
struct EquationsOfMotion {
  Eigen::Matrix<Scalar, kCoordinateCount, kCoordinateCount> mass;  // symmetric, positive definite
  Coordinates<Scalar> force;
};

template <class Scalar>
EquationsOfMotion<Scalar> ComputeEquationsOfMotion(const VehicleModel& model, const Coordinates<Scalar>& q,
                                                   const Coordinates<Scalar>& q_dot, const Inputs<Scalar>& u);

// q'' (m/s^2, rad/s^2).
template <class Scalar>
Coordinates<Scalar> Acceleration(const VehicleModel& model, const Coordinates<Scalar>& q,
                                 const Coordinates<Scalar>& q_dot, const Inputs<Scalar>& u) {
  const EquationsOfMotion<Scalar> equations = ComputeEquationsOfMotion(model, q, q_dot, u);
  return equations.mass.partialPivLu().solve(equations.force);
}

extern template EquationsOfMotion<double> ComputeEquationsOfMotion(const VehicleModel&,
                                                                   const Coordinates<double>&,
                                                                   const Coordinates<double>&,
                                                                   const Inputs<double>&);
extern template EquationsOfMotion<std::complex<double>> ComputeEquationsOfMotion(
    const VehicleModel&, const Coordinates<std::complex<double>>&, const Coordinates<std::complex<double>>&,
    const Inputs<std::complex<double>>&);

// Hover at yaw 0, found by Newton's method from level attitude; ignores model.hover, limits of inputs and
// stops. Throws DesignError when there is none.
Hover SolveHover(const VehicleModel& model);

Coordinates<double> HoverCoordinates(const Hover& hover);  // at the world's origin
Inputs<double> HoverInputs(const Hover& hover);

// x' = A x + B u about the hover, x = (q, q').
struct LinearModel {
  Eigen::Matrix<double, 2 * kCoordinateCount, 2 * kCoordinateCount> a;
  Eigen::Matrix<double, 2 * kCoordinateCount, kInputCount> b;
};
LinearModel Linearise(const VehicleModel& model, const Hover& hover);

}  // namespace tiltproof::plant
