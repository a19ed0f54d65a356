#include "faults/fault_type.h"

namespace tiltproof::faults {
namespace {

class Drop : public WireModel {
 public:
  explicit Drop(const WireSetup& setup) : probability_(setup.parameters.Number("probability")) {}

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    if (context.random.Bernoulli(probability_)) {
      context.Say("dropped");
    } else {
      out.push_back(std::move(chunk));
    }
  }

 private:
  double probability_;
};

}  // namespace

FaultType FrameDrop() {
  return {.name = "frame.drop",
          .summary = "Loses whole frames.",
          .semantics =
              "Models a queue that is full, or a modem that gives up after some attempts. A frame that the "
              "trigger picks is lost with the given probability. The line is idle in its place.",
          .source =
              "IEC 61784-3 (loss); Cristian, Understanding Fault-tolerant Distributed Systems, "
              "Communications of the ACM 34(2), 1991 (omission failures).",
          .parameters = {ProbabilityParameter("probability, per frame, that it is lost", 0.5)},
          .kind = WireKind{.wire_layer = WireLayer::kFrame,
                           .make = [](const WireSetup& setup) -> std::unique_ptr<WireModel> {
                             return std::make_unique<Drop>(setup);
                           },
                           .volume = Volume::kMayLose}};
}

}  // namespace tiltproof::faults
