#include "faults/fault_type.h"
#include "faults/frame_edit.h"
#include "link/check.h"
#include "link/fletcher16.h"

namespace tiltproof::faults {
namespace {

class ChecksumPreserving : public WireModel {
 public:
  explicit ChecksumPreserving(const WireSetup& setup)
      : probability_(setup.parameters.Number("probability")) {}

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    FrameEdit edit(chunk.bytes);
    std::vector<std::uint8_t>& payload = edit.payload();
    if (context.random.Bernoulli(probability_) && edit.ok() && payload.size() >= 3) {
      const std::size_t place = context.random.Below(payload.size() - 2);
      const auto d = static_cast<unsigned>(1 + context.random.Below(254));
      const auto add = [&payload](std::size_t at, unsigned difference) {
        CheckIndex(at, payload.size(), "a changed byte is inside the payload");
        payload[at] = static_cast<std::uint8_t>((payload[at] + difference) % link::kFletcherModulus);
      };
      add(place, d);
      add(place + 1, 2 * (link::kFletcherModulus - d));
      add(place + 2, d);
      edit.WriteTo(chunk.bytes);
      if (context.what != nullptr)
        context.Say("bytes " + std::to_string(place) + " to " + std::to_string(place + 2) +
                    " of the payload by " + std::to_string(d) + ", -2 times that, and that again");
    }
    out.push_back(std::move(chunk));
  }

 private:
  double probability_;
};

}  // namespace

FaultType FrameChecksumPreserving() {
  return {.name = "frame.checksum_preserving",
          .summary = "A damage that the checksum does not see.",
          .semantics =
              "Models the damage that Fletcher's checksum cannot detect. With the given probability, three "
              "successive bytes of the payload of a frame that the trigger picks change by d, -2d and d "
              "modulo 255. Both of Fletcher's sums stay the same. The place, and d from 1 to 254, are drawn "
              "evenly; at least one byte changes. The checksum in the frame is not touched, and bytes are "
              "escaped again. A payload of less than three bytes stays as it is. Only the length, id and "
              "ranges of the message are left to find this.",
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
