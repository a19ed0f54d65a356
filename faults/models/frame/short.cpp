#include "faults/fault_type.h"
#include "faults/frame_edit.h"

namespace tiltproof::faults {
namespace {

class ShortFrame : public WireModel {
 public:
  explicit ShortFrame(const WireSetup& setup)
      : framing_(*setup.protocol.framing),
        probability_(setup.parameters.Number("probability")),
        bytes_count_(static_cast<std::size_t>(setup.parameters.Integer("bytes_count"))) {}

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    FrameEdit edit(framing_, chunk.bytes);
    if (context.random.Bernoulli(probability_) && edit.ok() && bytes_count_ > 0 &&
        edit.payload().size() > 1) {
      const std::size_t size = edit.payload().size();
      edit.payload().resize(size > bytes_count_ ? size - bytes_count_ : 1);
      edit.WriteTo(chunk.bytes);
      if (context.what != nullptr)
        context.Say("payload of " + std::to_string(edit.payload().size()) + " bytes instead of " +
                    std::to_string(size));
    }
    out.push_back(std::move(chunk));
  }

 private:
  const link::Framing& framing_;
  double probability_;
  std::size_t bytes_count_;
};

}  // namespace

FaultType FrameShort() {
  return {
      .name = "frame.short",
      .summary = "A frame carries too few bytes.",
      .semantics =
          "Models a sender with an older or wrong table of messages. With the given probability, the payload "
          "of a frame that the trigger picks loses its last `bytes_count` bytes, or all but the first if it "
          "has no more. Check and length are those of the new payload, and the frame is encoded again; if "
          "the check was wrong before, it stays wrong in the same bits. Only the length of the message tells "
          "the receiver that something is missing. With the default `probability` of 1 this happens to each "
          "frame.",
      .source =
          "Cristian, Understanding Fault-tolerant Distributed Systems, Communications of the ACM 34(2), 1991 "
          "(value failures of a server).",
      .parameters = {{.name = "bytes_count",
                      .unit = "byte",
                      .kind = ParameterKind::kInteger,
                      .min = 0,
                      .max = 256,
                      .doc = "how many bytes are missing",
                      .example = 4.0,
                      .zero = 0.0,
                      .severity = Scale::kLinear},
                     ProbabilityOfEach("probability, per frame, that this happens", 0.5)},
      .kind = WireKind{.wire_layer = WireLayer::kFrame,
                       .make = [](const WireSetup& setup) -> std::unique_ptr<WireModel> {
                         return std::make_unique<ShortFrame>(setup);
                       },
                       .volume = Volume::kMayLose}};
}

}  // namespace tiltproof::faults
