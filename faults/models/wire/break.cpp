#include "faults/bits.h"
#include "faults/fault_type.h"

namespace tiltproof::faults {
namespace {

class Break : public WireModel {
 public:
  explicit Break(const WireSetup& setup) : rate_(setup.rate) {}

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    link::Chunk heard = chunk.Part(0, 0);
    std::size_t lost_count = 0;
    for (std::size_t i = 0; i < chunk.bytes.size(); ++i) {
      if (!context.ActiveDuringByte(chunk, i, rate_))
        heard.Append(chunk, i);
      else if (lost_count++ == 0)
        heard.Append(0, LowIsParityError(rate_.character));
    }
    if (context.what != nullptr && lost_count > 0)
      context.Say("break in place of " + std::to_string(lost_count) + " bytes");
    out.push_back(std::move(heard));
  }

 private:
  LineRate rate_;
};

}  // namespace

FaultType WireBreak() {
  return {
      .name = "wire.break",
      .summary = "The sender breaks off and holds the line low.",
      .semantics =
          "Models a driver that resets in the middle of a frame, or a program that sends a break. A frame "
          "loses the bytes that are on the line during any part of the window. The first of them arrives as "
          "00, which is what a receiver reads of a break; with odd parity, that has a parity error. What of "
          "the frame comes after the window arrives, "
          "directly behind the 00. Each frame that the window meets is broken off once. `every_nth_count` "
          "and `probability` choose among the frames that are on the line during the window.",
      .source =
          "Texas Instruments, PC16550D Universal Asynchronous Receiver/Transmitter With FIFOs, SNLS378C, "
          "2015 (break interrupt, framing error).",
      .parameters = {},
      .kind = WireKind{.wire_layer = WireLayer::kByte,
                       .make = [](const WireSetup& setup) -> std::unique_ptr<WireModel> {
                         return std::make_unique<Break>(setup);
                       },
                       .volume = Volume::kMayLose,
                       .acts_on_overlap = true}};
}

}  // namespace tiltproof::faults
