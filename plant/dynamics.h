// Equations of motion of a vehicle in minimal coordinates: what the controller design linearises.
//
//   q = (x, y, z, roll, pitch, yaw, alpha of each hinge)
//       position of the main body's frame origin (m), its Z-Y-X Euler angles (rad), hinge angles (rad)
//   u = (f of each rotor, tau or angle of each hinge)
//       thrusts in force (N), servo torques (N m) or commanded angles (rad)
//
// Derived with the principle of virtual power: with the Jacobians of every body's centre of mass velocity and
// angular velocity,
//   sum (m J_v^T a + J_w^T (I w' + w x I w)) = generalised forces,
//   a = J_v q'' + a_0,   w' = J_w q'' + w'_0.
// A position servo exerts whatever torque its hinge needs to follow the command in two lags, that of the angle
// (T, the vehicle's) and that of the rate (S, 2 ms):
//   T S alpha'' = angle - alpha - (T + S) alpha'.
// The plant has only the first lag, and a limit of the rate. Two lags keep alpha' a state and the model well
// conditioned.
// Without stops, ground, saturation and lag of rotors. Singular at pitch +/-90 deg.
//
// All in complex numbers: a complex step h gives derivatives without rounding, df/dx = Im f(x + ih) / h. The
// motion itself is the real part.
#pragma once

#include <Eigen/Core>
#include <complex>
#include <stdexcept>

#include "link/disturbance.h"
#include "plant/vehicle_model.h"

namespace tiltproof::plant {

// The sizes of q and u follow from the vehicle; these are the largest, so that no vector needs the heap.
inline constexpr int kCoordinatesMax = 6 + static_cast<int>(kRotorsMax);
inline constexpr int kInputsMax = 2 * static_cast<int>(kRotorsMax);

template <class Scalar>
using Coordinates = Eigen::Matrix<Scalar, Eigen::Dynamic, 1, Eigen::ColMajor, kCoordinatesMax, 1>;
template <class Scalar>
using Inputs = Eigen::Matrix<Scalar, Eigen::Dynamic, 1, Eigen::ColMajor, kInputsMax, 1>;

inline Eigen::Index CoordinateCount(const VehicleModel& model) {
  return 6 + static_cast<Eigen::Index>(model.hinges.size());
}
inline Eigen::Index InputCount(const VehicleModel& model) {
  return static_cast<Eigen::Index>(model.rotors.size() + model.hinges.size());
}

// The vehicle has no hover, or a design on it has no answer.
struct DesignError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

using Complex = std::complex<double>;

// M(q) q'' = force(q, q', u), force including gravity and the velocity-dependent terms. The row of a position servo's
// hinge is the servo's law.
struct EquationsOfMotion {
  // Symmetric and positive definite when all servos are torques.
  Eigen::Matrix<Complex, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, kCoordinatesMax, kCoordinatesMax>
      mass;
  Coordinates<Complex> force;
};
EquationsOfMotion ComputeEquationsOfMotion(const VehicleModel& model, const Coordinates<Complex>& q,
                                           const Coordinates<Complex>& q_dot, const Inputs<Complex>& u);

// q'' (m/s^2, rad/s^2).
Coordinates<Complex> Acceleration(const VehicleModel& model, const Coordinates<Complex>& q,
                                  const Coordinates<Complex>& q_dot, const Inputs<Complex>& u);

// Hover at yaw 0, found by Newton's method from level attitude; ignores model.hover, limits of inputs and
// stops. A vehicle with more actuators than equations has many hovers. This is the one with the smallest sum of
// squares of thrusts and torques, as shares of their limits, and of roll, pitch and hinge angles, as shares of
// 0.1 rad. Throws DesignError when there is none.
Hover SolveHover(const VehicleModel& model);

Coordinates<double> HoverCoordinates(const Hover& hover);  // at the world's origin
Inputs<double> HoverInputs(const Hover& hover);

// x' = A x + B u about the hover, x = (q, q').
struct LinearModel {
  Eigen::MatrixXd a;  // 2 n x 2 n for n coordinates
  Eigen::MatrixXd b;  // 2 n x the number of inputs
};
LinearModel Linearise(const VehicleModel& model, const Hover& hover);

}  // namespace tiltproof::plant
