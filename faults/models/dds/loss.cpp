#include "faults/fault_type.h"

namespace tiltproof::faults {

FaultType DdsLoss() {
  return {.name = "dds.loss",
          .summary = "Loses packets between the nodes.",
          .semantics =
              "Of the packets that the node sends on DDS each is lost with `probability`, by draws of the "
              "middleware that no seed repeats. Throughout the flight, so without a window: it is set when "
              "the node joins.",
          .parameters = {NodeParameter({"base_station", "client", "plant", "link", "all"}),
                         ProbabilityParameter("of losing a packet", 0.1)},
          .kind = NodeKind{.make = [](const Parameters& parameters) -> NodeAction {
            return LosePackets{.probability = parameters.Number("probability")};
          }},
          .start = Bound::kRefused,
          .end = Bound::kRefused,
          .needs = Needs::kNodes};
}

}  // namespace tiltproof::faults
