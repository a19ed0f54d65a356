// Where the program finds the vehicle models that it ships. Its firmware: harness/client/firmware_files.h.
#pragma once

#include <filesystem>

namespace tiltproof::harness {

// The folder with <name>.sdf: share/tiltproof/models of an installed program, otherwise plant/models of the
// source tree from which it was built.
std::filesystem::path ModelsFolder();

}  // namespace tiltproof::harness
