// The flag --client: its text, its help, and that what it names is there.
#pragma once

#include <string>
#include <vector>

#include "harness/scenario/client_spec.h"
#include "harness/scenario/scenario.h"

namespace tiltproof::harness {

// For --help: every form with what it means.
std::string ClientHelp();

// Throws UsageError naming what is wrong with the flag, or that there is no such library.
ClientSpec ReadClientFlag(const std::string& text);

// All flags of a command: each CLIENT, for every client of the scenarios, or ID=CLIENT, for those of that id. The same
// for an unknown id, one that no scenario has.
RunClients ReadClientFlags(const std::vector<std::string>& texts);
void CheckClientIds(const RunClients& clients, const std::vector<const Scenario*>& scenarios);

// That a library is one, before anything is flown. Throws UsageError.
void CheckLibrary(const ClientSpec& client);

// That a board's ports can be had, before anything is flown: a flag that names no device is a mistake of the command
// line (UsageError), a device that is busy or not permitted is trouble with the target (std::runtime_error).
void CheckPorts(const ClientSpec& client, const LinkSpec& link);

// What tells this program and the clients' firmware from other builds (harness/report/build_id.h).
std::string BuildOf(const RunClients& clients);

// Whether one is an image on an emulated board.
bool Emulates(const std::vector<ClientSpec>& clients);

}  // namespace tiltproof::harness
