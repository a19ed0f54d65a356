#include "faults/fault_type.h"

namespace tiltproof::faults {

FaultType NodeKill() {
  return {
      .name = "node.kill",
      .summary = "Kills a node, for good.",
      .semantics =
          "Models a process or a computer that dies: a crash, a lack of memory, a supply that fails. At "
          "`start_s`, the node and every process that it has started are killed (SIGKILL). The loss of the "
          "client's node is a failure of the firmware. The loss of any other node is an error of the "
          "harness: such a scenario needs `expect: error`.",
      .source =
          "Cristian, Understanding Fault-tolerant Distributed Systems, Communications of the ACM 34(2), "
          "1991 (crash failures); Basiri et al., Chaos Engineering, IEEE Software 33(3), 2016.",
      .parameters = {NodeParameter({"client", "plant", "link", "base_station"})},
      .kind = NodeKind{.make = [](const Parameters&) -> NodeAction { return KillNode{}; }},
      .start = Bound::kRequired,
      .end = Bound::kRefused,
      .needs = Needs::kNodes};
}

}  // namespace tiltproof::faults
