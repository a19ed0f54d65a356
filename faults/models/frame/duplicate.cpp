#include "faults/fault_type.h"

namespace tiltproof::faults {
namespace {

class Duplicate : public WireModel {
 public:
  explicit Duplicate(const WireSetup& setup)
      : probability_(setup.parameters.Number("probability")), rate_(setup.rate) {}

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    if (!context.random.Bernoulli(probability_)) {
      out.push_back(std::move(chunk));
      return;
    }
    link::Chunk copy = chunk;
    copy.begin_ns += rate_.BytesTime(static_cast<std::int64_t>(chunk.bytes.size()));
    out.push_back(std::move(chunk));
    out.push_back(std::move(copy));
    context.Say("duplicated");
  }

 private:
  double probability_;
  LineRate rate_;
};

}  // namespace

FaultType FrameDuplicate() {
  return {
      .name = "frame.duplicate",
      .summary = "Sends whole frames twice.",
      .semantics =
          "Models a sender that does not know that its message arrived and sends it again, or a network with "
          "two ways. A frame that the trigger picks is followed by its copy with the given probability. "
          "Later faults treat the copy as a separate frame. What is sent next waits until the line is free.",
      .source = "IEC 61784-3 (unintended repetition).",
      .parameters = {ProbabilityParameter("probability, per frame, that it is sent twice", 0.5)},
      .kind = WireKind{.wire_layer = WireLayer::kFrame,
                       .make = [](const WireSetup& setup) -> std::unique_ptr<WireModel> {
                         return std::make_unique<Duplicate>(setup);
                       },
                       .volume = Volume::kDoubles}};
}

}  // namespace tiltproof::faults
