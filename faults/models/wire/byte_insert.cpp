#include "faults/bits.h"
#include "faults/fault_type.h"

namespace tiltproof::faults {
namespace {

class ByteInsert : public WireModel {
 public:
  explicit ByteInsert(double probability) : probability_(probability) {}

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    link::Chunk edited = chunk.Part(0, 0);
    edited.bytes.reserve(chunk.bytes.size() + chunk.bytes.size() / 2);
    for (std::size_t i = 0; i < chunk.bytes.size(); ++i) {
      if (context.random.Bernoulli(probability_)) {
        edited.Append(static_cast<std::uint8_t>(context.random.Below(256)), false);
        if (context.what != nullptr)
          context.Say(Hex(edited.bytes.back()) + " inserted before byte " + std::to_string(i));
      }
      edited.Append(chunk, i);
    }
    out.push_back(std::move(edited));
  }

 private:
  double probability_;
};

}  // namespace

FaultType WireByteInsert() {
  return {
      .name = "wire.byte_insert",
      .summary = "Adds random bytes.",
      .semantics =
          "Models noise on an idle line that a receiver takes for a start bit. Before every byte of a "
          "frame, a byte of uniformly random value is inserted with the given probability, independently of "
          "the others. The bytes after it arrive one byte time later.",
      .source =
          "STMicroelectronics, RM0090 Reference manual (STM32F4), section 30.3.3 (start bit detection, and "
          "what it refuses as noise).",
      .parameters = {ProbabilityParameter("probability, per byte, that another is inserted before it", 0.01)},
      .kind = WireKind{.wire_layer = WireLayer::kByte,
                       .make = [](const WireSetup& setup) -> std::unique_ptr<WireModel> {
                         return std::make_unique<ByteInsert>(setup.parameters.Number("probability"));
                       },
                       .volume = Volume::kDoubles}};
}

}  // namespace tiltproof::faults
