#include "faults/fault_type.h"

namespace tiltproof::faults {
namespace {

class Silence : public WireModel {
 public:
  void Act(link::Chunk&& /*chunk*/, const WireContext& context, std::vector<link::Chunk>& /*out*/) override {
    context.Say("not sent");
  }
};

}  // namespace

FaultType LinkSilence() {
  return {.name = "link.silence",
          .summary = "A sender stops sending.",
          .semantics =
              "Models a sender that has crashed or waits for something: what it sends, it sends whole. A "
              "frame whose first byte would enter the line within the window is not sent at all. A frame "
              "that began before the window is sent to its end. Without a target, both directions of the "
              "main line are silent.",
          .source =
              "Cristian, Understanding Fault-tolerant Distributed Systems, Communications of the ACM 34(2), "
              "1991 (omission and crash failures).",
          .kind = WireKind{.wire_layer = WireLayer::kFrame,
                           .make = [](const WireSetup&) -> std::unique_ptr<WireModel> {
                             return std::make_unique<Silence>();
                           },
                           .default_target = Target::kBoth,
                           .volume = Volume::kMayLose}};
}

}  // namespace tiltproof::faults
