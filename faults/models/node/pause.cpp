#include "faults/fault_type.h"

namespace tiltproof::faults {

FaultType NodePause() {
  return {.name = "node.pause",
          .summary = "Stops a node and lets it go on later, as if it had been given no processor time.",
          .semantics =
              "Models a process that gets no processor time: a busy machine, a garbage collector, a virtual "
              "machine that is moved. The node is stopped at `start_s` (SIGSTOP) and continues at `end_s` "
              "(SIGCONT). It then finds everything that has waited for it meanwhile. Its clock keeps "
              "running.",
          .source =
              "Cristian, Understanding Fault-tolerant Distributed Systems, Communications of the ACM 34(2), "
              "1991 (timing failures).",
          .parameters = {NodeParameter({"client", "plant", "link", "base_station"})},
          .kind = NodeKind{.make = [](const Parameters&) -> NodeAction { return PauseNode{}; }},
          .start = Bound::kRequired,
          .end = Bound::kRequired,
          .needs = Needs::kNodes};
}

}  // namespace tiltproof::faults
