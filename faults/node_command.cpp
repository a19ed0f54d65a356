#include "faults/node_command.h"

#include <algorithm>
#include <variant>

#include "faults/registry.h"

namespace tiltproof::faults {

std::vector<NodeCommand> NodeCommands(const std::vector<FaultSpec>& specs) {
  std::vector<NodeCommand> commands;
  for (std::size_t fault = 0; fault < specs.size(); ++fault) {
    const FaultSpec& spec = specs[fault];
    const FaultType& type = ValidType(spec);
    const auto* node = type.As<NodeKind>();
    const auto* clock = type.As<ClockKind>();
    if (node == nullptr && clock == nullptr) continue;
    const Parameters parameters = ResolvedParameters(spec, type);
    const NodeAction action = node != nullptr ? node->make(parameters)
                                              : std::visit([](const auto& act) -> NodeAction { return act; },
                                                           clock->make(parameters));
    for (const Window& stretch : Activity(spec, WindowOf(spec)).Stretches())
      commands.push_back(
          {.at_ns = clock != nullptr ? std::max<TimeNs>(stretch.begin_ns, 0) : stretch.begin_ns,
           .until_ns = stretch.end_ns,
           .fault = fault,
           .node = parameters.Choice("node"),
           .action = action});
  }
  std::stable_sort(commands.begin(), commands.end(),
                   [](const NodeCommand& a, const NodeCommand& b) { return a.at_ns < b.at_ns; });
  return commands;
}

}  // namespace tiltproof::faults
