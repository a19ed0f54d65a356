// The flag --client: its text, its help, and the check that what it names exists.
#pragma once

#include <string>
#include <vector>

#include "harness/scenario/client_spec.h"
#include "harness/scenario/scenario.h"

namespace tiltproof::harness {

// For --help: every form with its meaning.
std::string ClientHelp();

// Throws UsageError naming the error in the flag, or the missing library.
ClientSpec ReadClientFlag(const std::string& text);

// "b=host" has the id "b", "process:./a --b=c" and "qemu:x.elf,main=usart1" have none: "".
std::string ClientIdOf(const std::string& text);

// Reads all flags of a command. Each is CLIENT, for every client of the scenarios, or ID=CLIENT, for those with that
// id. Throws UsageError.
RunClients ReadClientFlags(const std::vector<std::string>& texts);
// Throws UsageError for an id that no scenario has.
void CheckClientIds(const RunClients& clients, const std::vector<const Scenario*>& scenarios);

// For a shell, in quotes.
std::string Quoted(const std::string& text);
// The flags that give these clients, each behind a space.
std::string ClientFlagsOf(const RunClients& clients);

// Checks that a library is one, and that an image is there, before anything is flown. Throws UsageError.
void CheckFirmwareFile(const ClientSpec& client);

// Checks that a board's ports can be used, before anything is flown. A flag that names no device is an error
// in the command line (UsageError); a device that is busy or not permitted is a failure of the target
// (std::runtime_error).
void CheckPorts(const ClientSpec& client, const Scenario& scenario);

// Identifies the build of this program and of the clients' firmware (harness/report/build_id.h).
std::string BuildOf(const RunClients& clients);

// True if any client is an image on an emulated board.
bool Emulates(const std::vector<ClientSpec>& clients);

}  // namespace tiltproof::harness
