// The client of a lockstep flight.
//
//   const auto client = MakeClient(HostLibrary{}, SettingsOf(scenario), host);
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "harness/client/client.h"
#include "harness/client/debugger.h"
#include "harness/client/emulator_client.h"
#include "harness/scenario/client_spec.h"
#include "link/protocol.h"

namespace tiltproof::harness {

// A scenario's requirements on its client.
struct ClientSettings {
  std::string firmware;  // build; a user's image is already a build
  std::shared_ptr<const link::Protocol> protocol;
  EmulatorLines lines;
  TimeNs start_within_ns = 0;      // time that a busy image has to start
  std::vector<std::string> watch;  // variables of the image
  std::optional<DebugStop> debug = {};
  bool coverage = false;  // it tells what code it executes
  // Makes the text TiltproofHost::parameters (harness/run/client_parameters.h).
  std::function<std::string()> parameters = {};
  std::size_t place = 0;  // of this client among several
};

// The build that flies any vehicle with a gain of its own.
inline constexpr std::string_view kLqrBuild = "lqr";
// The build of which two boards fly one vehicle: it asks which of them it is.
inline constexpr std::string_view kFailoverBuild = "failover";
// True for a library that gets parameters. The other shipped builds for the tilt-rotor hold their own numbers.
inline bool TakesParameters(const HostLibrary& library, const std::string& firmware) {
  return !library.file.empty() || firmware == kLqrBuild || firmware == kFailoverBuild;
}

// Throws std::runtime_error that says what is wrong with the client or its file. For a library, a FirmwareGuard is
// installed in this process, whose output is the firmware's as long as a client of a user's file exists.
std::unique_ptr<Client> MakeClient(const ClientSpec& client, const ClientSettings& settings, ClientHost host);

}  // namespace tiltproof::harness
