// Where the program finds the vehicle models that it ships. Its firmware: harness/client/firmware_files.h.
#pragma once

#include <filesystem>

namespace tiltproof::harness {

// The folder with <name>.sdf: share/tiltproof/models of an installed program; in a build folder `models`,
// a link to plant/models of the source tree.
std::filesystem::path ModelsFolder();

}  // namespace tiltproof::harness
