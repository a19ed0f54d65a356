#include "faults/fault_type.h"
#include "faults/frame_edit.h"

namespace tiltproof::faults {
namespace {

class ChecksumPreserving : public WireModel {
 public:
  explicit ChecksumPreserving(const WireSetup& setup)
      : framing_(*setup.protocol.framing), probability_(setup.parameters.Number("probability")) {}

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    const link::BlindSpot blind_spot = framing_.blind_spot();
    FrameEdit edit(framing_, chunk.bytes);
    if (context.random.Bernoulli(probability_) && blind_spot.bytes_count > 0 && edit.ok() &&
        edit.payload().size() >= blind_spot.bytes_count) {
      const std::size_t size = blind_spot.bytes_count;
      const std::size_t place = context.random.Below(edit.payload().size() - size + 1);
      const auto way = static_cast<std::uint32_t>(context.random.Below(blind_spot.ways_count));
      const std::string change = framing_.ChangeUnseen(std::span(edit.payload()).subspan(place, size), way);
      edit.WriteTo(chunk.bytes);
      if (context.what != nullptr)
        context.Say("bytes " + std::to_string(place) + " to " + std::to_string(place + size - 1) +
                    " of the payload " + change);
    }
    out.push_back(std::move(chunk));
  }

 private:
  const link::Framing& framing_;
  double probability_;
};

}  // namespace

FaultType FrameChecksumPreserving() {
  return {.name = "frame.checksum_preserving",
          .summary = "A damage that the check does not see.",
          .semantics =
              "Models the damage that the protocol's check cannot detect. With the given probability, "
              "successive bytes of the payload of a frame that the trigger picks change. With `fletcher16` "
              "three bytes change by d, -2d and d modulo 255, with d from 1 to 254, so both sums stay the "
              "same. With `sum8` two bytes change by d and -d modulo 256, and with `none` one byte by d, "
              "with d from 1 to 255. With a CRC the generator polynomial, times x^0 to x^7, is added to "
              "three bytes (CRC-16) or five (CRC-32). The place and the change are drawn evenly; at least "
              "one byte changes. The check in the frame is not touched, and the frame is encoded again. A "
              "shorter payload stays as it is. Only the length, id, ranges, sequence and time of the message "
              "are left to find this.",
          .source =
              "Fletcher, An Arithmetic Checksum for Serial Transmissions, IEEE Transactions on "
              "Communications 30(1), 1982; Maxino and Koopman, The Effectiveness of Checksums for Embedded "
              "Control Networks, IEEE Transactions on Dependable and Secure Computing 6(1), 2009.",
          .parameters = {ProbabilityParameter("probability, per frame, that it is changed", 0.3)},
          .kind = WireKind{
              .wire_layer = WireLayer::kFrame,
              .make = [](const WireSetup& setup) -> std::unique_ptr<WireModel> {
                return std::make_unique<ChecksumPreserving>(setup);
              },
              .volume = Volume::kMayLose  // fewer escapes
          }};
}

}  // namespace tiltproof::faults
