// Where the program finds what it ships: vehicle models and the host build of the firmware.
#pragma once

#include <filesystem>
#include <string>

namespace tiltproof::harness {

// Holds <name>.sdf: share/tiltproof/models of an installed program, else plant/models of the source tree it
// was built from.
std::filesystem::path ModelsFolder();

// The firmware's host library: lib/tiltproof beside an installed program's bin, else lib of the build folder.
std::filesystem::path HostFirmwareLibrary();

// The library behind --client. Throws UsageError naming what is wrong with the flag.
std::filesystem::path FirmwareLibrary(const std::string& client);

}  // namespace tiltproof::harness
