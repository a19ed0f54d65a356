#include "faults/fault_type.h"

namespace tiltproof::faults {

FaultType DdsPartition() {
  return {.name = "dds.partition",
          .summary = "Cuts a node off from the bus.",
          .semantics =
              "Models a switch or cable that fails between machines that go on. From `start_s` to `end_s`, "
              "nothing that the node publishes on DDS reaches another node, and nothing reaches the node. "
              "With `all`, no node reaches any other. The serial line does not use DDS and keeps working. "
              "Without `end_s`, the node stays cut off. A node that is away for more than 5 s is given up, "
              "and the verdict is error.",
          .source = "Bailis and Kingsbury, The Network is Reliable, Communications of the ACM 57(9), 2014.",
          .parameters = {NodeParameter({"base_station", "client", "plant", "link", "all"})},
          .kind = NodeKind{.make = [](const Parameters&) -> NodeAction { return PartitionNode{}; }},
          .start = Bound::kRequired,
          .needs = Needs::kNodes};
}

}  // namespace tiltproof::faults
