#include "faults/bits.h"
#include "faults/fault_type.h"

namespace tiltproof::faults {
namespace {

class LengthError : public WireModel {
 public:
  explicit LengthError(const WireSetup& setup)
      : framing_(*setup.protocol.framing), probability_(setup.parameters.Number("probability")) {}

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    std::vector<std::size_t> places;
    const std::vector<link::ByteRole> roles = framing_.Roles(chunk.bytes);
    for (std::size_t i = 0; i < roles.size(); ++i)
      if (roles[i] == link::ByteRole::kLength) places.push_back(i);
    if (context.random.Bernoulli(probability_) && !places.empty()) {
      const std::size_t place = places[context.random.Below(places.size())];
      const auto wrong = static_cast<std::uint8_t>(chunk.bytes[place] + 1 + context.random.Below(255));
      if (context.what != nullptr) context.Say("length: " + ByteChange(place, chunk.bytes[place], wrong));
      chunk.bytes[place] = wrong;
    }
    out.push_back(std::move(chunk));
  }

 private:
  const link::Framing& framing_;
  double probability_;
};

}  // namespace

FaultType FrameLengthError() {
  return {
      .name = "frame.length_error",
      .summary = "The length in front of a frame is wrong.",
      .semantics =
          "Models the worst place that a damaged byte can have where a length says how long a frame is. With "
          "the given probability, one byte of the length field of a frame that the trigger picks gets "
          "another value. All bytes of the field and all other values are equally likely. With a length that "
          "is too large, the receiver takes the bytes of the next frames for this one's, and loses them too. "
          "With one that is too small, the rest of the frame belongs to no frame. A chunk without a length "
          "stays as it is.",
      .source =
          "Koopman, Driscoll and Hall, Selection of Cyclic Redundancy Code and Checksum Algorithms to Ensure "
          "Critical Data Integrity, DOT/FAA/TC-14/49, 2015 (corrupted length fields).",
      .parameters = {ProbabilityParameter("probability, per frame, that its length is wrong", 0.3)},
      .kind = WireKind{.wire_layer = WireLayer::kFrame,
                       .make = [](const WireSetup& setup) -> std::unique_ptr<WireModel> {
                         return std::make_unique<LengthError>(setup);
                       },
                       .needs_role = link::ByteRole::kLength}};
}

}  // namespace tiltproof::faults
