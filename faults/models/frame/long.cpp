#include "faults/fault_type.h"
#include "faults/frame_edit.h"

namespace tiltproof::faults {
namespace {

class LongFrame : public WireModel {
 public:
  explicit LongFrame(const WireSetup& setup)
      : framing_(*setup.protocol.framing),
        probability_(setup.parameters.Number("probability")),
        bytes_count_(static_cast<std::size_t>(setup.parameters.Integer("bytes_count"))) {}

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    FrameEdit edit(framing_, chunk.bytes);
    if (context.random.Bernoulli(probability_) && edit.ok() && bytes_count_ > 0) {
      for (std::size_t i = 0; i < bytes_count_; ++i)
        edit.payload().push_back(static_cast<std::uint8_t>(context.random.Below(256)));
      edit.WriteTo(chunk.bytes);
      if (context.what != nullptr)
        context.Say("payload with " + std::to_string(bytes_count_) + " bytes more");
    }
    out.push_back(std::move(chunk));
  }

 private:
  const link::Framing& framing_;
  double probability_;
  std::size_t bytes_count_;
};

}  // namespace

FaultType FrameLong() {
  return {.name = "frame.long",
          .summary = "A frame carries too many bytes.",
          .semantics =
              "Models a sender with a newer or wrong table of messages, or one that overruns its buffer. "
              "With the given probability, `bytes_count` random bytes are appended to the payload of a frame "
              "that the trigger picks. Check and length are those of the new payload, and the frame is "
              "encoded again; if the check was wrong before, it stays wrong in the same bits. A length field "
              "of one byte holds the length modulo 256. A payload beyond the largest that a receiver keeps "
              "must not overrun the receiver's buffer. With the default `probability` of 1 this happens to "
              "each frame.",
          .source =
              "Cristian, Understanding Fault-tolerant Distributed Systems, Communications of the ACM 34(2), "
              "1991 (value failures of a server).",
          .parameters = {{.name = "bytes_count",
                          .unit = "byte",
                          .kind = ParameterKind::kInteger,
                          .min = 0,
                          .max = 1000,
                          .doc = "how many bytes too many",
                          .example = 4.0,
                          .zero = 0.0,
                          .severity = Scale::kLinear},
                         ProbabilityOfEach("probability, per frame, that this happens", 0.5)},
          .kind = WireKind{.wire_layer = WireLayer::kFrame,
                           .make = [](const WireSetup& setup) -> std::unique_ptr<WireModel> {
                             return std::make_unique<LongFrame>(setup);
                           }}};
}

}  // namespace tiltproof::faults
