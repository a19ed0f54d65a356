// The tiltproof elements that a vehicle still lacks.
#pragma once

#include <filesystem>
#include <string>

#include "plant/sdf_files.h"
#include "plant/vehicle_elements.h"
#include "plant/vehicle_tree.h"

namespace tiltproof::plant {

// The text of `<stem>.tiltproof.xml` for the file: all that its joints and plugins reveal, and FILL_IN in place
// of each number that nothing states. With these filled in, the vehicle loads. Throws VehicleError.
std::string VehicleMapping(const std::filesystem::path& file);

// For the message of an error: where elements go, followed by those that the vehicle lacks, with numbers that
// are examples. Empty when none is missing.
std::string MissingElements(const SdfFiles& files, const VehicleTree& tree, const VehicleElements& present);

}  // namespace tiltproof::plant
