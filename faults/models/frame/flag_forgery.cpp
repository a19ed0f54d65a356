#include "faults/bits.h"
#include "faults/fault_type.h"

namespace tiltproof::faults {
namespace {

class FlagForgery : public WireModel {
 public:
  explicit FlagForgery(const WireSetup& setup)
      : flag_(setup.protocol.framing->flag().value()), probability_(setup.parameters.Number("probability")) {}

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    std::vector<std::size_t> places;
    for (std::size_t i = 0; i < chunk.bytes.size(); ++i)
      if (chunk.bytes[i] != flag_) places.push_back(i);
    if (context.random.Bernoulli(probability_) && !places.empty()) {
      const std::size_t place = places[context.random.Below(places.size())];
      if (context.what != nullptr) context.Say(ByteChange(place, chunk.bytes[place], flag_));
      chunk.bytes[place] = flag_;
    }
    out.push_back(std::move(chunk));
  }

 private:
  std::uint8_t flag_;
  double probability_;
};

}  // namespace

FaultType FrameFlagForgery() {
  return {
      .name = "frame.flag_forgery",
      .summary = "A byte in the middle of a frame becomes a flag.",
      .semantics =
          "Models the worst place that a damaged byte can have. With the given probability, one byte of a "
          "frame that the trigger picks, other than a flag, becomes a flag: 7E in `hdlc`, 00 in `cobs`. All "
          "of them are equally likely, the check, escapes and codes included. The receiver sees two frames: "
          "the byte splits the frame. A frame without such a byte stays as it is.",
      .source =
          "RFC 1662, PPP in HDLC-like Framing, IETF, 1994, section 4.3 (how receivers treat such frames).",
      .parameters = {ProbabilityParameter("probability, per frame, that it is split", 0.3)},
      .kind = WireKind{.wire_layer = WireLayer::kFrame,
                       .make = [](const WireSetup& setup) -> std::unique_ptr<WireModel> {
                         return std::make_unique<FlagForgery>(setup);
                       },
                       .needs_role = link::ByteRole::kFlagByte}};
}

}  // namespace tiltproof::faults
