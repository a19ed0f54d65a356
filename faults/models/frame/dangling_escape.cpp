#include "faults/fault_type.h"

namespace tiltproof::faults {
namespace {

class DanglingEscape : public WireModel {
 public:
  explicit DanglingEscape(const WireSetup& setup)
      : flag_(setup.protocol.framing->flag().value()),
        escape_(setup.protocol.framing->escape().value()),
        probability_(setup.parameters.Number("probability")) {}

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    if (context.random.Bernoulli(probability_) && chunk.bytes.size() > 1 && chunk.bytes.back() == flag_) {
      chunk.bytes.insert(chunk.bytes.end() - 1, escape_);
      context.Say("escape before the closing flag");
    }
    out.push_back(std::move(chunk));
  }

 private:
  std::uint8_t flag_, escape_;
  double probability_;
};

}  // namespace

FaultType FrameDanglingEscape() {
  return {
      .name = "frame.dangling_escape",
      .summary = "An escape stands directly before the closing flag.",
      .semantics =
          "Models a sender that gives up in the middle of an escaped byte. With the given probability, an "
          "escape (7D in `hdlc`) is inserted before the closing flag of a frame that the trigger picks. RFC "
          "1662 calls this an abort: the receiver must drop the frame, and must not take the flag for an "
          "escaped byte. A chunk without a closing flag stays as it is.",
      .source =
          "RFC 1662, PPP in HDLC-like Framing, IETF, 1994, section 4.3 (how receivers treat such frames).",
      .parameters = {ProbabilityParameter("probability, per frame, that it ends in an escape", 0.3)},
      .kind = WireKind{.wire_layer = WireLayer::kFrame,
                       .make = [](const WireSetup& setup) -> std::unique_ptr<WireModel> {
                         return std::make_unique<DanglingEscape>(setup);
                       },
                       .needs_role = link::ByteRole::kEscapeByte}};
}

}  // namespace tiltproof::faults
