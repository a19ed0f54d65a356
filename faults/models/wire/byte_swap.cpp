#include <utility>

#include "faults/fault_type.h"

namespace tiltproof::faults {
namespace {

class ByteSwap : public WireModel {
 public:
  explicit ByteSwap(const WireSetup& setup) : probability_(setup.parameters.Number("probability")) {}

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    for (std::size_t i = 0; i + 1 < chunk.bytes.size(); ++i) {
      if (!context.random.Bernoulli(probability_)) continue;
      if (context.what != nullptr && chunk.bytes[i] != chunk.bytes[i + 1])
        context.Say("bytes " + std::to_string(i) + " and " + std::to_string(i + 1) + " swapped");
      std::swap(chunk.bytes[i], chunk.bytes[i + 1]);
      if (!chunk.parity_errors.empty()) std::swap(chunk.parity_errors[i], chunk.parity_errors[i + 1]);
      ++i;
    }
    out.push_back(std::move(chunk));
  }

 private:
  double probability_;
};

}  // namespace

FaultType WireByteSwap() {
  return {.name = "wire.byte_swap",
          .summary = "Neighbouring bytes change places.",
          .semantics =
              "Models a buffer that two routines write at once, or a transfer in words of the wrong order. "
              "From the first byte of a frame on, each byte changes places with the next one with the given "
              "probability; a byte that has been moved is not moved again. Equal neighbours that change "
              "places change nothing.",
          .source =
              "Stone and Partridge, When The CRC and TCP Checksum Disagree, ACM SIGCOMM 2000 (data that is "
              "misplaced in hosts, not on lines).",
          .parameters = {ProbabilityParameter("probability, per byte, that it changes places with the next",
                                              0.02)},
          .kind = WireKind{.wire_layer = WireLayer::kByte,
                           .make = [](const WireSetup& setup) -> std::unique_ptr<WireModel> {
                             return std::make_unique<ByteSwap>(setup);
                           }}};
}

}  // namespace tiltproof::faults
