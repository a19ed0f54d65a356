// Where the program finds the firmware that it ships, and the file of a client's firmware.
//
//   FirmwareFile(HostLibrary{}, "paper", dialect);      // <build>/lib/libtiltproof_firmware.so
//   FirmwareFile(EmulatedImage{}, "paper", dialect);    // <build>/firmware/stm32f4/executive-paper.elf
//
// An installed program has its files next to its bin folder; a program in a build folder has them in that
// folder.
#pragma once

#include <filesystem>
#include <string>

#include "harness/emulator/emulator_process.h"
#include "harness/scenario/client_spec.h"
#include "link/protocol.h"

namespace tiltproof::harness {

// This program's file, and its folder.
std::filesystem::path ProgramFile();
std::filesystem::path ProgramFolder();

// A library that comes with this program.
std::filesystem::path ShippedLibrary(const std::string& name);

// The lockstep plug-in of the emulator.
std::filesystem::path LockstepPlugin();

// The library or image that flies when a scenario names this build of the firmware; empty for any other kind
// of client.
std::filesystem::path FirmwareFile(const ClientSpec& client, const std::string& firmware,
                                   const std::string& dialect);

// The way to get images of the shipped firmware that are not there, for a user.
std::string HowToGetImages();

// An emulated board with the image, which speaks this protocol. `place`: its own among several; `lines`: ids of the lines
// to other boards. Throws std::runtime_error when the image has no USART for one.
EmulatorSpec BoardOf(const EmulatedImage& image, const std::string& firmware, const link::Protocol& protocol,
                     std::size_t place = 0, const std::vector<std::string>& lines = {});

}  // namespace tiltproof::harness
