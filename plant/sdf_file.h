// Reading of an SDF file by libsdformat, with its errors as problems. Internal to LoadVehicle.
#pragma once

#include <filesystem>
#include <sdf/Root.hh>
#include <vector>

#include "plant/vehicle_model.h"

namespace tiltproof::plant {

// Adds the errors to `problems`, but for lines that have one already, and for impossible inertias. Prints nothing.
void LoadSdf(const std::filesystem::path& file, sdf::Root& root, std::vector<VehicleProblem>& problems);

}  // namespace tiltproof::plant
