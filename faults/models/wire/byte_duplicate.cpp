#include "faults/bits.h"
#include "faults/fault_type.h"

namespace tiltproof::faults {
namespace {

class ByteDuplicate : public WireModel {
 public:
  explicit ByteDuplicate(double probability) : probability_(probability) {}

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    link::Chunk edited = chunk.Part(0, 0);
    edited.bytes.reserve(chunk.bytes.size() + chunk.bytes.size() / 2);
    for (std::size_t i = 0; i < chunk.bytes.size(); ++i) {
      edited.Append(chunk, i);
      if (!context.random.Bernoulli(probability_)) continue;
      edited.Append(chunk, i);
      if (context.what != nullptr)
        context.Say("byte " + std::to_string(i) + " " + Hex(chunk.bytes[i]) + " repeated");
    }
    out.push_back(std::move(edited));
  }

 private:
  double probability_;
};

}  // namespace

FaultType WireByteDuplicate() {
  return {.name = "wire.byte_duplicate",
          .summary = "Sends single bytes twice.",
          .semantics =
              "Models a driver that takes the same byte out of its receiver or buffer twice, as two "
              "routines do that share an index without a lock. Every byte of a frame, flags included, is "
              "repeated once with the given probability, independently of the others. The bytes after it "
              "arrive one byte time later.",
          .source = "IEC 61784-3 (unintended repetition, there of messages).",
          .parameters = {ProbabilityParameter("probability, per byte, that it is repeated", 0.01)},
          .kind = WireKind{.wire_layer = WireLayer::kByte,
                           .make = [](const WireSetup& setup) -> std::unique_ptr<WireModel> {
                             return std::make_unique<ByteDuplicate>(setup.parameters.Number("probability"));
                           },
                           .volume = Volume::kDoubles}};
}

}  // namespace tiltproof::faults
