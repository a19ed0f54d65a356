// Where the program finds the vehicle models that it ships. Its firmware: harness/client/firmware_files.h.
#pragma once

#include <filesystem>

namespace tiltproof::harness {

// Holds <name>.sdf: share/tiltproof/models of an installed program, else plant/models of the source tree it
// was built from.
std::filesystem::path ModelsFolder();

}  // namespace tiltproof::harness
