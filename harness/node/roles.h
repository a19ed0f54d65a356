// The kinds of node. Each is one file of this folder.
#pragma once

#include "harness/node/node.h"
#include "harness/run/bus_place.h"

namespace tiltproof::harness {

// The server end of the line behind a serial port: plant, sensors, actuators, trace (harness/run/plant_server.h).
std::unique_ptr<Role> MakePlantRole(NodeServices& services, const NodeOptions& options);

// The link between the plant's port and the client's: paces bytes at the baud rate, injects the wire's
// faults, logs every frame (harness/run/line.h). Makes the pseudo-terminals to which others connect.
std::unique_ptr<Role> MakeLinkRole(NodeServices& services, const NodeOptions& options);

// The line between two boards, with its faults: what one of them sends, the other one gets (harness/run/board_line.h).
std::unique_ptr<Role> MakeLineRole(NodeServices& services, const NodeOptions& options);

// The firmware as a process: a firmware library with the machine's clock, a user's command, or an image in an
// emulator.
std::unique_ptr<Role> MakeLibraryRole(NodeServices& services, const NodeOptions& options);
std::unique_ptr<Role> MakeCommandRole(NodeServices& services, const NodeOptions& options);
std::unique_ptr<Role> MakeEmulatorRole(NodeServices& services, const NodeOptions& options);

// The sender of references over the second line (paper, section 2.2, Figure 6): the scenario's trajectory by
// the simulation's clock, or a person's joystick.
std::unique_ptr<Role> MakeBaseStationRole(NodeServices& services, const NodeOptions& options);
std::unique_ptr<Role> MakeJoystickRole(NodeServices& services, const NodeOptions& options);

// Prints what happens on the bus at the target until SIGINT or SIGTERM. It takes part in no run.
int RunMonitor(const NodeOptions& options, const FindWatchTarget& target);

}  // namespace tiltproof::harness
