// Rotors and position servos that the plugins of simulators describe. Internal to LoadVehicle.
//
// Gazebo's motor model (libgazebo_motor_model.so of gazebo-classic and RotorS, MulticopterMotorModel of gz-sim)
// pushes the rotor's link along the link's z axis, at the link's centre of mass: AddRelativeForce and
// AddWorldForce act there. A propeller that turns ccw has a drag torque of -momentConstant * thrust about z.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "plant/sdf_files.h"
#include "plant/vehicle_elements.h"

namespace tiltproof::plant {

// In the order of the files. A rotor whose plugin does not state all numbers lists what is missing.
std::vector<RotorElement> RotorsOfPlugins(const SdfFiles& files, std::vector<VehicleProblem>& problems);

// A joint that a plugin moves to an angle.
struct PositionPlugin {
  const SdfPart* plugin = nullptr;
  std::optional<double> speed_max_rad_s;
};
std::optional<PositionPlugin> PositionPluginOf(const SdfFiles& files, const std::string& joint);

}  // namespace tiltproof::plant
