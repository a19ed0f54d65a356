#include "faults/bits.h"
#include "faults/fault_type.h"

namespace tiltproof::faults {
namespace {

class ByteDrop : public WireModel {
 public:
  explicit ByteDrop(double probability) : probability_(probability) {}

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    link::Chunk kept = chunk.Part(0, 0);
    for (std::size_t i = 0; i < chunk.bytes.size(); ++i) {
      if (context.random.Bernoulli(probability_)) {
        if (context.what != nullptr)
          context.Say("byte " + std::to_string(i) + " " + Hex(chunk.bytes[i]) + " lost");
      } else {
        kept.Append(chunk, i);
      }
    }
    if (!kept.bytes.empty()) out.push_back(std::move(kept));
  }

 private:
  double probability_;
};

}  // namespace

FaultType WireByteDrop() {
  return {.name = "wire.byte_drop",
          .summary = "Loses single bytes.",
          .semantics =
              "Models a receiver that is read too late, or a buffer that is full. Every byte of a frame, "
              "flags included, is lost with the given probability, independently of the others. The bytes "
              "after it close the gap: they arrive one byte time earlier. A frame that loses all its bytes "
              "vanishes.",
          .source =
              "Texas Instruments, PC16550D Universal Asynchronous Receiver/Transmitter With FIFOs, "
              "SNLS378C, 2015 (overrun error).",
          .parameters = {ProbabilityParameter("probability, per byte, that it is lost", 0.01)},
          .kind = WireKind{.wire_layer = WireLayer::kByte,
                           .make = [](const WireSetup& setup) -> std::unique_ptr<WireModel> {
                             return std::make_unique<ByteDrop>(setup.parameters.Number("probability"));
                           },
                           .volume = Volume::kMayLose}};
}

}  // namespace tiltproof::faults
