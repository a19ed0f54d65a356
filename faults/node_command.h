// Faults on nodes: what the harness is to do to a process, its place on the bus or its clock, and when.
//
// Such a fault does not edit data. It is a command, and the part that runs the nodes carries it out. An
// action that is forgotten does not compile:
//
//   for (const NodeCommand& command : NodeCommands(scenario.faults))
//     At(command.at_ns, [&] { std::visit(Overloaded{[&](const KillNode&) { Kill(command.node); }, ...}, command.action); });
#pragma once

#include <cstddef>
#include <string>
#include <variant>
#include <vector>

#include "faults/clock_action.h"
#include "faults/fault.h"
#include "link/time.h"

namespace tiltproof::faults {

struct KillNode {};       // for good
struct PauseNode {};      // stopped, and continued at the end
struct RestartNode {};    // killed, and started again at the end
struct PartitionNode {};  // cut off the bus until the end
struct LosePackets {      // throughout the flight
  double probability = 0.0;
};
using NodeAction =
    std::variant<KillNode, PauseNode, RestartNode, PartitionNode, LosePackets, DriftClock, JumpClock>;

struct NodeCommand {
  TimeNs at_ns = kPowerOn;   // simulation time; kPowerOn: before the node joins the flight
  TimeNs until_ns = kNever;  // when it is reverted; kNever: not at all
  std::size_t fault = 0;     // index in the scenario's list
  std::string node;          // "plant", "link", "client", "base_station", "all"
  NodeAction action;
};

// The commands of the faults on nodes or clocks, in order of time; at equal times in the order of the file.
// Throws std::invalid_argument, naming fault and key, when a fault is not valid.
std::vector<NodeCommand> NodeCommands(const std::vector<FaultSpec>& specs);

}  // namespace tiltproof::faults
