#include "faults/model.h"

namespace tiltproof::faults {

FaultType NodeKill() {
  return {
      .name = "node.kill",
      .stage = Stage::kNode,
      .summary = "Kills a node, for good.",
      .semantics =
          "At `start_s` the node and everything that it has started are killed (SIGKILL). The loss of the "
          "client's node is the firmware's failure, that of any other an error of the harness: with such a "
          "scenario "
          "say `expect: error`.",
      .parameters = {NodeParameter({"client", "plant", "link", "base_station"})},
      .on_node = true,
      .start = Bound::kRequired,
      .end = Bound::kRefused,
      .needs = Needs::kNodes};
}

}  // namespace tiltproof::faults
