#include "faults/fault_type.h"

namespace tiltproof::faults {

FaultType NodeKill() {
  return {
      .name = "node.kill",
      .summary = "Kills a node, for good.",
      .semantics =
          "At `start_s`, the node and every process that it has started are killed (SIGKILL). The loss of "
          "the client's node is a failure of the firmware. The loss of any other node is an error of the "
          "harness: such a scenario needs `expect: error`.",
      .parameters = {NodeParameter({"client", "plant", "link", "base_station"})},
      .kind = NodeKind{.make = [](const Parameters&) -> NodeAction { return KillNode{}; }},
      .start = Bound::kRequired,
      .end = Bound::kRefused,
      .needs = Needs::kNodes};
}

}  // namespace tiltproof::faults
