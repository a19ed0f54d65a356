#include "faults/fault_type.h"

namespace tiltproof::faults {

FaultType DdsLoss() {
  return {.name = "dds.loss",
          .summary = "Loses packets between the nodes.",
          .semantics =
              "Models a radio or an overloaded switch between the machines. Each packet that the node sends "
              "on DDS is lost with `probability`. The middleware draws these losses, and no seed repeats "
              "them. The loss is set when the node joins and lasts the whole flight, so the fault has no "
              "window.",
          .source =
              "OMG, DDS Interoperability Wire Protocol (DDSI-RTPS), version 2.3, 2019 (reliable writers, "
              "which send again what was lost).",
          .parameters = {NodeParameter({"base_station", "client", "plant", "link", "all"}),
                         ProbabilityParameter("probability, per packet, that it is lost", 0.1)},
          .kind = NodeKind{.make = [](const Parameters& parameters) -> NodeAction {
            return LosePackets{.probability = parameters.Number("probability")};
          }},
          .start = Bound::kRefused,
          .end = Bound::kRefused,
          .needs = Needs::kNodes};
}

}  // namespace tiltproof::faults
