#include "faults/fault_type.h"

namespace tiltproof::faults {

FaultType NodeKill() {
  return {
      .name = "node.kill",
      .summary = "Kills a node, for good.",
      .semantics =
          "At `start_s` the node and everything that it has started are killed (SIGKILL). The loss of the "
          "client's node is the firmware's failure, that of any other an error of the harness: with such a "
          "scenario "
          "say `expect: error`.",
      .parameters = {NodeParameter({"client", "plant", "link", "base_station"})},
      .kind = NodeKind{.make = [](const Parameters&) -> NodeAction { return KillNode{}; }},
      .start = Bound::kRequired,
      .end = Bound::kRefused,
      .needs = Needs::kNodes};
}

}  // namespace tiltproof::faults
