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
// All in complex numbers: a complex step h gives derivatives without rounding, df/dx = Im f(x + ih) / h. The
// motion itself is the real part.
#pragma once

#include <Eigen/Core>
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

using Complex = std::complex<double>;

// M(q) q'' = force(q, q', u), force including gravity and the velocity-dependent terms.
struct EquationsOfMotion {
  Eigen::Matrix<Complex, kCoordinateCount, kCoordinateCount> mass;  // symmetric, positive definite
  Coordinates<Complex> force;
};
EquationsOfMotion ComputeEquationsOfMotion(const VehicleModel& model, const Coordinates<Complex>& q,
                                           const Coordinates<Complex>& q_dot, const Inputs<Complex>& u);

// q'' (m/s^2, rad/s^2).
Coordinates<Complex> Acceleration(const VehicleModel& model, const Coordinates<Complex>& q,
                                  const Coordinates<Complex>& q_dot, const Inputs<Complex>& u);

// Hover at yaw 0, found by Newton's method from level attitude; ignores model.hover, limits of inputs and
// stops. Throws DesignError when there is none.
Hover SolveHover(const VehicleModel& model);

Coordinates<double> HoverCoordinates(const Hover& hover);  // at the world's origin
Inputs<double> HoverInputs(const Hover& hover);

// x' = A x + B u about the hover, x = (q, q').
struct LinearModel {
  Eigen::MatrixXd a;  // 16 x 16
  Eigen::MatrixXd b;  // 16 x 4
};
LinearModel Linearise(const VehicleModel& model, const Hover& hover);

}  // namespace tiltproof::plant
