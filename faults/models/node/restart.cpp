#include "faults/fault_type.h"

namespace tiltproof::faults {

FaultType NodeRestart() {
  return {.name = "node.restart",
          .summary = "Kills a node and starts it again.",
          .semantics =
              "The node is killed at `start_s` (SIGKILL) and started again `down_ms` later. It has lost all "
              "it knew: a firmware begins with `start`. The fault is active while the node is down.",
          .parameters = {NodeParameter({"client", "base_station"}),
                         {.name = "down_ms",
                          .unit = "ms",
                          .min = 0.0,
                          .max = 600'000.0,
                          .doc = "time from the kill to the new start",
                          .example = 500.0}},
          .kind = NodeKind{.make = [](const Parameters&) -> NodeAction { return RestartNode{}; },
                           .asks_restart = true},
          .start = Bound::kRequired,
          .end = Bound::kRefused,
          .duration_ms = "down_ms",
          .needs = Needs::kNodes};
}

}  // namespace tiltproof::faults
