// Geometry of a vehicle by libsdformat, with its errors as problems. Internal to LoadVehicle.
#pragma once

#include <sdf/Root.hh>
#include <set>
#include <string>
#include <vector>

#include "plant/sdf_files.h"
#include "plant/vehicle_model.h"

namespace tiltproof::plant {

// The name that libsdformat has for "load::box", and back.
std::string InnerName(std::string name);
std::string OuterName(std::string name);

// Gives libsdformat one flat model: all links with their inertias and collisions, the joints in `hinges` with
// their axes, and all other joints as fixed ones. Adds its errors to `problems`, but for lines that have one
// already, and for impossible inertias. Prints nothing.
void LoadSdf(const SdfFiles& files, const std::set<std::string>& hinges, sdf::Root& root,
             std::vector<VehicleProblem>& problems);

}  // namespace tiltproof::plant
