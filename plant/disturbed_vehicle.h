// The effect of a disturbance on the vehicle: other masses of its bodies, and the drag of the air. Internal
// to the plant.
#pragma once

#include <Eigen/Core>
#include <string_view>

#include "link/disturbance.h"
#include "plant/vehicle_model.h"

namespace tiltproof::plant {

// The vehicle with the disturbance's factors of mass and inertia, and its shift of the centre of mass. Its
// hover stays that of the undisturbed vehicle, which is what its controller knows.
VehicleModel WithBodies(const VehicleModel& vehicle, const Disturbance& disturbance);

// N, along the axes of the velocity `v_m_s`, which is relative to the air.
Eigen::Vector3d DragForce(const BodyDrag& drag, const Eigen::Vector3d& v_m_s);

// The reason that no plant can apply it: a value is not a number, or a factor of mass or inertia is not positive.
// Empty when a plant can apply it.
std::string_view DisturbanceProblem(const Disturbance& disturbance);

}  // namespace tiltproof::plant
