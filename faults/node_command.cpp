#include "faults/node_command.h"

#include <algorithm>

#include "faults/registry.h"

namespace tiltproof::faults {

std::vector<NodeCommand> NodeCommands(const std::vector<FaultSpec>& specs) {
  std::vector<NodeCommand> commands;
  for (std::size_t fault = 0; fault < specs.size(); ++fault) {
    const FaultSpec& spec = specs[fault];
    const FaultType& type = ValidType(spec);
    if (!type.on_node) continue;
    const Window window = WindowOf(spec);
    Parameters parameters = ResolvedParameters(spec, type);
    std::string node = parameters.Choice("node");
    commands.push_back({.at_ns = window.begin_ns,
                        .until_ns = window.end_ns,
                        .fault = fault,
                        .type = spec.type,
                        .node = std::move(node),
                        .parameters = std::move(parameters)});
  }
  std::stable_sort(commands.begin(), commands.end(),
                   [](const NodeCommand& a, const NodeCommand& b) { return a.at_ns < b.at_ns; });
  return commands;
}

}  // namespace tiltproof::faults
