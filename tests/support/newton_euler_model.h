// An oracle for the motion of any vehicle: Newton's and Euler's equations of each body by itself, with the forces and
// torques in the hinges as unknowns. plant/dynamics.h derives the same from Jacobians, without these unknowns.
#pragma once

#include <Eigen/Core>

#include "plant/vehicle_model.h"

namespace tiltproof::testing {

// q'' for q = (position, Z-Y-X Euler angles, hinge angles) and u = (thrusts, servo torques). SI units.
Eigen::VectorXd NewtonEulerAcceleration(const plant::VehicleModel& model, const Eigen::VectorXd& q,
                                        const Eigen::VectorXd& q_dot, const Eigen::VectorXd& u);

}  // namespace tiltproof::testing
