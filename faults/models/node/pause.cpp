#include "faults/fault_type.h"

namespace tiltproof::faults {

FaultType NodePause() {
  return {.name = "node.pause",
          .summary = "Stops a node and lets it go on later, as a starved processor would.",
          .semantics =
              "At `start_s` the node is stopped (SIGSTOP), at `end_s` it continues (SIGCONT) with what has "
              "waited "
              "for it meanwhile. Its clock runs on.",
          .parameters = {NodeParameter({"client", "plant", "link", "base_station"})},
          .kind = NodeKind{.make = [](const Parameters&) -> NodeAction { return PauseNode{}; }},
          .start = Bound::kRequired,
          .end = Bound::kRequired,
          .needs = Needs::kNodes};
}

}  // namespace tiltproof::faults
