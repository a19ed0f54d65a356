// Where the program finds what it ships: vehicle models and the host build of the firmware.
#pragma once

#include <filesystem>
#include <string>

#include "harness/client/make_client.h"
#include "harness/scenario/scenario.h"
#include "link/messages.h"

namespace tiltproof::harness {

// Holds <name>.sdf: share/tiltproof/models of an installed program, else plant/models of the source tree it
// was built from.
std::filesystem::path ModelsFolder();

// The firmware's host library: lib/tiltproof beside an installed program's bin, else lib of the build folder.
std::filesystem::path HostFirmwareLibrary();

// This program itself, to start nodes with.
std::filesystem::path ProgramFile();

// The lockstep plug-in of the emulator.
std::filesystem::path LockstepPlugin();

// Our firmware as an image for the emulated board: `scheduler` is "executive" or "freertos".
std::filesystem::path FirmwareImage(const std::string& scheduler, const std::string& firmware,
                                    link::Dialect dialect);

// What --client names; one of the four kinds.
struct ClientChoice {
  std::string text;                      // as run.json keeps it: with the library's absolute path
  std::filesystem::path library;         // host, library:FILE
  std::string command;                   // process:CMD
  std::string device, reference_device;  // serial:DEV[,REFDEV]
  bool has_our_builds = false;           // it flies what the scenario's `firmware` names
  // qemu[:...]: an image, or (`image` empty) the scenario's firmware under this scheduler.
  bool emulator = false;
  std::filesystem::path image;
  std::string scheduler = "executive";
  int main_usart = 2, reference_usart = 3, console_usart = 1;

  // Whether it can fly in virtual time.
  bool knows_virtual_time() const { return !library.empty() || emulator; }
  // The firmware's file of a flight: library or image.
  std::filesystem::path FirmwareFile(const Scenario& scenario) const;
  // One file that tells builds of the firmware apart, whatever the scenario; empty when there is none.
  std::filesystem::path BuiltFile() const;
  // Of a client that knows virtual time.
  ClientSource SourceFor(const Scenario& scenario) const;
};
// Throws UsageError naming what is wrong with the flag.
ClientChoice ChooseClient(const std::string& client);

}  // namespace tiltproof::harness
