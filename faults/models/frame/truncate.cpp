#include "faults/fault_type.h"

namespace tiltproof::faults {
namespace {

class Truncate : public WireModel {
 public:
  explicit Truncate(const WireSetup& setup) : probability_(setup.parameters.Number("probability")) {}

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    if (context.random.Bernoulli(probability_) && chunk.bytes.size() > 1) {
      const std::size_t size = chunk.bytes.size();
      const auto kept = static_cast<std::size_t>(1 + context.random.Below(size - 1));
      chunk.bytes.resize(kept);
      if (context.what != nullptr)
        context.Say("cut after byte " + std::to_string(kept - 1) + " of " + std::to_string(size));
    }
    out.push_back(std::move(chunk));
  }

 private:
  double probability_;
};

}  // namespace

FaultType FrameTruncate() {
  return {.name = "frame.truncate",
          .summary = "Cuts frames short.",
          .semantics =
              "Models a sender that is reset or interrupted in the middle of a frame, or a buffer that is "
              "too short. A frame that the trigger picks is cut short with the given probability. At least "
              "one byte goes on and at least one byte is lost; all possible lengths are equally likely. The "
              "end of the frame is always lost. In `hdlc` the opening flag of the next frame ends it. In "
              "`cobs` the next frame belongs to it, up to its flag. In `length_prefixed` bytes of the next "
              "frames complete it. A frame of a single byte stays as it is.",
          .source =
              "RFC 1662, PPP in HDLC-like Framing, IETF, 1994, section 4.3 (how receivers treat such "
              "frames).",
          .parameters = {ProbabilityParameter("probability, per frame, that it is cut", 0.5)},
          .kind = WireKind{.wire_layer = WireLayer::kFrame,
                           .make = [](const WireSetup& setup) -> std::unique_ptr<WireModel> {
                             return std::make_unique<Truncate>(setup);
                           },
                           .volume = Volume::kMayLose}};
}

}  // namespace tiltproof::faults
