// Faults on nodes: what the harness is to do to a process, its place on the bus or its clock, and when.
//
// Such a fault edits nothing that passes. It is a command, and who runs the nodes carries it out:
//
//   FaultSchedule faults(scenario.faults, scenario.seed);
//   for (const NodeCommand& command : NodeCommands(scenario.faults)) {
//     At(command.at_ns, [&] { Kill(command.node); faults.Count(command.fault, now, "killed"); });
//   }
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "faults/fault.h"
#include "faults/model.h"
#include "link/time.h"

namespace tiltproof::faults {

struct NodeCommand {
  TimeNs at_ns = kPowerOn;  // simulation time; kPowerOn: before the node joins the flight
  TimeNs until_ns =
      kNever;  // when it is taken back (continued, started again, joined, set right); kNever: not at all
  std::size_t fault = 0;  // index in the scenario's list
  std::string type;       // "node.pause"
  std::string node;       // "plant", "link", "client", "base_station", "all"
  Parameters parameters;  // of the type, defaults filled in
};

// Those of the faults that are on nodes, in order of time, at the same time in the order of the file. Throws
// std::invalid_argument, naming fault and key, when a fault is not valid.
std::vector<NodeCommand> NodeCommands(const std::vector<FaultSpec>& specs);

}  // namespace tiltproof::faults
