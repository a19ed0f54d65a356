#include "faults/bits.h"
#include "faults/fault_type.h"

namespace tiltproof::faults {
namespace {

class BitError : public WireModel {
 public:
  explicit BitError(const WireSetup& setup)
      : ber_(setup.parameters.Number("ber")), character_(setup.rate.character) {}

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    {
      BitFlipper bits(chunk, context, character_);
      for (std::uint64_t bit = context.random.FailuresBefore(ber_); bit < bits.BitCount();
           bit += 1 + context.random.FailuresBefore(ber_)) {
        bits.Flip(bit);
      }
    }
    out.push_back(std::move(chunk));
  }

 private:
  double ber_;
  link::CharacterFormat character_;
};

}  // namespace

FaultType WireBitError() {
  return {
      .name = "wire.bit_error",
      .summary = "Flips bits independently of each other.",
      .semantics =
          "Models a line with too much noise for its signal: a long cable without a shield, a level "
          "that is too low. Every bit is at the same risk. Every data bit of a frame, flags and escapes "
          "included, is flipped with probability `ber`, and so is every parity bit on a line with parity. "
          "Start and stop bits are not flipped, so the receiver stays in step with the bytes.",
      .source =
          "Proakis and Salehi, Digital Communications, 5th ed., McGraw-Hill, 2008 (binary symmetric "
          "channel).",
      .parameters = {{.name = "ber",
                      .unit = "1",
                      .min = 0.0,
                      .max = 1.0,
                      .doc = "bit error ratio: probability that a bit is flipped",
                      .example = 1e-3,
                      .zero = 0.0,
                      .severity = Scale::kLogarithmic}},
      .kind = WireKind{.wire_layer = WireLayer::kByte,
                       .make = [](const WireSetup& setup) -> std::unique_ptr<WireModel> {
                         return std::make_unique<BitError>(setup);
                       }}};
}

}  // namespace tiltproof::faults
