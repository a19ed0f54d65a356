#include "faults/fault_type.h"

namespace tiltproof::faults {

FaultType NodeRestart() {
  return {.name = "node.restart",
          .summary = "Kills a node and starts it again.",
          .semantics =
              "Models a program that its supervisor starts again after a crash, or a computer that boots. "
              "The node is killed at `start_s` (SIGKILL) and started again `down_ms` later. It has lost all "
              "it knew: a firmware begins with `start`. The fault is active while the node is down.",
          .source =
              "Cristian, Understanding Fault-tolerant Distributed Systems, Communications of the ACM 34(2), "
              "1991 (amnesia crashes); Candea and Fox, Crash-Only Software, HotOS IX, 2003.",
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
