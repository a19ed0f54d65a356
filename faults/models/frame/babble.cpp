#include <optional>

#include "faults/between_frames.h"
#include "faults/fault_type.h"

namespace tiltproof::faults {
namespace {

class Babble : public WireModel {
 public:
  explicit Babble(const WireSetup& setup) : flag_(setup.protocol.framing->flag()), events_(setup) {}

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    const auto& events = events_.Since(chunk, context);
    link::Chunk noise{
        .begin_ns = chunk.begin_ns, .bytes = {}, .message = chunk.message, .number = chunk.number};
    out.push_back(std::move(chunk));
    for (const PoissonEvents::Event& event : events) {
      Random random(event.key);
      noise.bytes.assign(3 + random.Below(64), flag_.value_or(0));
      const std::size_t flags = flag_ ? 1 : 0;  // at each end
      for (std::size_t i = flags; i + flags < noise.bytes.size(); ++i)
        noise.bytes[i] = static_cast<std::uint8_t>(random.Below(256));
      out.push_back(noise);
      if (context.what != nullptr)
        context.Say("noise of " + std::to_string(noise.bytes.size()) + " bytes behind it");
    }
  }

  void Pass(link::Chunk&& chunk, std::vector<link::Chunk>& out) override {
    events_.Skip(chunk);
    out.push_back(std::move(chunk));
  }

 private:
  std::optional<std::uint8_t> flag_;
  EventsBetweenFrames events_;
};

}  // namespace

FaultType FrameBabble() {
  return {
      .name = "frame.babble",
      .summary = "A babbling idiot fills the line with frames of noise.",
      .semantics =
          "Models a sender that has failed and sends all the time. Frames of noise follow the frames that "
          "pass. They come as a Poisson process of `rate_hz` in the time of the flight. Those of one control "
          "period are sent, in the order of their times, directly behind the first frame of a later period, "
          "if the trigger picks that frame. They take time on the line. So the same ones follow a frame "
          "whether its sender computes fast or slowly. Nothing enters the line between frames: a receiver "
          "that has waited until then may have gone on already. Only what falls into the fault's active time "
          "counts, of a pause of more than a second only the last second, and nothing before the first "
          "frame. What would follow a frame that the trigger does not pick is left out. Each has 1 to 64 "
          "bytes of uniformly random value, of uniformly random number, between two flags. Where frames have "
          "a length in front, it has 3 to 66 bytes, which may be the marks of a frame. They delay the frames "
          "behind them; when they take more than the line carries, the delay grows.",
      .source =
          "Kopetz, Real-Time Systems: Design Principles for Distributed Embedded Applications, Kluwer, 1997 "
          "(babbling idiot); Temple, Avoiding the Babbling-Idiot Failure in a Time-Triggered Communication "
          "System, FTCS-28, IEEE, 1998.",
      .parameters = {RateParameter("frames of noise per second", 100.0)},
      .kind = WireKind{.wire_layer = WireLayer::kFrame,
                       .make = [](const WireSetup& setup) -> std::unique_ptr<WireModel> {
                         return std::make_unique<Babble>(setup);
                       },
                       .remembers = true}};
}

}  // namespace tiltproof::faults
