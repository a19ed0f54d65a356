#include <algorithm>
#include <optional>

#include "faults/fault_type.h"

namespace tiltproof::faults {
namespace {

class FlagLoss : public WireModel {
 public:
  explicit FlagLoss(const WireSetup& setup)
      : flag_(setup.protocol.framing->flag().value()), probability_(setup.parameters.Number("probability")) {}

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    const bool loses = context.random.Bernoulli(probability_);
    const auto is_content = [this](std::uint8_t byte) { return byte != flag_; };
    const auto content = std::find_if(chunk.bytes.begin(), chunk.bytes.end(), is_content);
    if (content == chunk.bytes.end()) {
      out.push_back(std::move(chunk));
      return;
    }
    if (open_number_ && *open_number_ + 1 == chunk.number && content != chunk.bytes.begin()) {
      chunk.bytes.erase(chunk.bytes.begin(), content);
      context.Say("opening flag lost");
    }
    open_number_.reset();
    if (loses && chunk.bytes.back() == flag_) {
      chunk.bytes.pop_back();
      open_number_ = chunk.number;
      context.Say("closing flag lost");
    }
    out.push_back(std::move(chunk));
  }

 private:
  std::uint8_t flag_;
  double probability_;
  std::optional<std::uint64_t> open_number_;  // of the latest frame that lost its closing flag
};

}  // namespace

FaultType FrameFlagLoss() {
  return {
      .name = "frame.flag_loss",
      .summary = "The flag between two frames is lost.",
      .semantics =
          "Models a receiver that misses the byte which ends a frame: 7E in `hdlc`, 00 in `cobs`. With the "
          "given probability, a frame that the trigger picks loses its closing flag. If the next frame on "
          "the line is picked too, it loses its opening flags, so that the two arrive as one. Usually both "
          "are lost, because the check is wrong. If the next frame is not picked, its opening flag ends this "
          "frame: it arrives whole, but only then. In `cobs` no frame has an opening flag, so the two always "
          "arrive as one. A frame without anything between its flags stays as it is.",
      .source =
          "RFC 1662, PPP in HDLC-like Framing, IETF, 1994, section 4.3 (how receivers treat such frames).",
      .parameters = {ProbabilityParameter("probability, per frame, that its closing flag is lost", 0.3)},
      .kind = WireKind{.wire_layer = WireLayer::kFrame,
                       .make = [](const WireSetup& setup) -> std::unique_ptr<WireModel> {
                         return std::make_unique<FlagLoss>(setup);
                       },
                       .volume = Volume::kMayLose,
                       .remembers = true,
                       .needs_role = link::ByteRole::kFlagByte}};
}

}  // namespace tiltproof::faults
