#include "faults/bits.h"
#include "faults/fault_type.h"

namespace tiltproof::faults {
namespace {

// E. N. Gilbert, "Capacity of a burst-noise channel" (1960), with errors in both states as E. O. Elliott
// (1963).
class GilbertElliott : public WireModel {
 public:
  explicit GilbertElliott(const WireSetup& setup)
      : good_{setup.parameters.Number("p_bad"), setup.parameters.Number("ber_good")},
        bad_{setup.parameters.Number("p_good"), setup.parameters.Number("ber_bad")},
        character_(setup.rate.character) {}

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    {
      BitFlipper bits(chunk, context, character_);
      Random& random = context.random;
      // A state ends after the first bit that draws its end, so it lasts 1 + FailuresBefore bits. What is
      // left of it at the end of a frame is drawn again at the next: the number of failures has no memory.
      for (std::uint64_t begin = 0; begin < bits.BitCount();) {
        const State& state = in_bad_ ? bad_ : good_;
        const std::uint64_t last = begin + random.FailuresBefore(state.p_leave);
        const std::uint64_t end = last < bits.BitCount() ? last + 1 : bits.BitCount();
        for (std::uint64_t bit = begin + random.FailuresBefore(state.ber); bit < end;
             bit += 1 + random.FailuresBefore(state.ber)) {
          bits.Flip(bit);
        }
        if (last < bits.BitCount()) in_bad_ = !in_bad_;
        begin = end;
      }
    }
    out.push_back(std::move(chunk));
  }

 private:
  struct State {
    double p_leave;
    double ber;
  };
  State good_, bad_;
  link::CharacterFormat character_;
  bool in_bad_ = false;
};

ParameterInfo Probability(std::string_view name, std::string_view doc, double example,
                          std::optional<ParameterValue> zero = std::nullopt,
                          std::optional<Scale> severity = std::nullopt) {
  return {.name = name,
          .unit = "1",
          .min = 0.0,
          .max = 1.0,
          .doc = doc,
          .example = example,
          .zero = std::move(zero),
          .severity = severity};
}

}  // namespace

FaultType WireGilbertElliott() {
  return {
      .name = "wire.gilbert_elliott",
      .summary = "Flips bits in bursts: a channel with a good and a bad state.",
      .semantics =
          "Models a line whose errors come in clusters: a radio that fades, a plug that is loose, a motor "
          "beside the cable. A Markov chain takes one step per data bit, and per parity bit on a line with "
          "parity. In each state, a bit is flipped "
          "with the error ratio of that state. After each bit, the chain leaves the good state with "
          "probability `p_bad`, and the bad state with probability `p_good`, so a bad stretch lasts 1/p_good "
          "bits on average. The chain begins in the good state and keeps its state from one frame to the "
          "next. Idle time does not move it, and neither do frames that the trigger leaves out.",
      .source =
          "Gilbert, Capacity of a Burst-Noise Channel, Bell System Technical Journal 39(5), 1960; Elliott, "
          "Estimates of Error Rates for Codes on Burst-Noise Channels, Bell System Technical Journal 42(5), "
          "1963.",
      .parameters = {Probability("p_bad", "probability, per bit, of entering the bad state", 1e-3),
                     Probability("p_good", "probability, per bit, of leaving the bad state", 0.1),
                     Probability("ber_good", "bit error ratio in the good state", 0.0, 0.0),
                     Probability("ber_bad", "bit error ratio in the bad state", 0.5, 0.0,
                                 Scale::kLogarithmic)},
      .kind = WireKind{.wire_layer = WireLayer::kByte,
                       .make = [](const WireSetup& setup) -> std::unique_ptr<WireModel> {
                         return std::make_unique<GilbertElliott>(setup);
                       }}};
}

}  // namespace tiltproof::faults
