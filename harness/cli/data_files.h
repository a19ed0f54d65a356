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

// This program itself, to start nodes with.
std::filesystem::path ProgramFile();

// What --client names; one of the three kinds.
struct ClientChoice {
  std::string text;                      // as run.json keeps it: with the library's absolute path
  std::filesystem::path library;         // host, library:FILE
  std::string command;                   // process:CMD
  std::string device, reference_device;  // serial:DEV[,REFDEV]
  // Whether it can fly in virtual time.
  bool knows_virtual_time() const { return !library.empty(); }
};
// Throws UsageError naming what is wrong with the flag.
ClientChoice ChooseClient(const std::string& client);

}  // namespace tiltproof::harness
