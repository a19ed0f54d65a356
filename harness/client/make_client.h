// The client of a lockstep flight, from what the command line names.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "harness/client/client.h"
#include "harness/client/emulator_client.h"
#include "link/messages.h"

namespace tiltproof::harness {

// One of the two.
struct ClientSource {
  std::string library = {};                   // a shared library: firmware/tiltproof_client.h
  std::optional<EmulatorSpec> emulator = {};  // an image on an emulated board
};

// What a scenario asks of it.
struct ClientSettings {
  std::string firmware;  // build; an image is one already
  link::Dialect dialect{};
  EmulatorLines lines;
  TimeNs start_within_ns = 0;  // until then a busy image has time to start
};

// Throws std::runtime_error that says what is wrong with the file. For a library, a FirmwareGuard is installed in this
// process, whose output is the firmware's as long as the client exists.
std::unique_ptr<Client> MakeClient(const ClientSource& source, const ClientSettings& settings,
                                   ClientHost host);

}  // namespace tiltproof::harness
