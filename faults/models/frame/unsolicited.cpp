#include <algorithm>

#include "faults/between_frames.h"
#include "faults/fault_type.h"
#include "faults/field_range.h"
#include "faults/text.h"

namespace tiltproof::faults {
namespace {

class Unsolicited : public WireModel {
 public:
  explicit Unsolicited(const WireSetup& setup)
      : protocol_(setup.protocol), types_(TypesOf(setup.protocol, setup.direction)), events_(setup) {}

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    const auto& events = events_.Since(chunk, context);
    link::Chunk forged{
        .begin_ns = chunk.begin_ns, .bytes = {}, .message = chunk.message, .number = chunk.number};
    out.push_back(std::move(chunk));
    if (types_.empty()) return;
    for (const PoissonEvents::Event& event : events) {
      Random random(event.key);
      const link::MessageType& type = *types_[random.Below(types_.size())];
      std::vector<double> values;
      for (const link::MessageField& field : type.fields) {
        const auto [min, max] = MadeUpRange(field);
        values.push_back(std::clamp(min + (max - min) * random.Uniform(), min, max));
      }
      forged.bytes = protocol_.framing->Encode(protocol_.Encode(type, values).span());
      out.push_back(forged);
      if (context.what != nullptr) context.Say(Concat({"forged ", type.name, " behind it"}));
    }
  }

  void Pass(link::Chunk&& chunk, std::vector<link::Chunk>& out) override {
    events_.Skip(chunk);
    out.push_back(std::move(chunk));
  }

 private:
  static std::vector<const link::MessageType*> TypesOf(const link::Protocol& protocol,
                                                       link::Direction direction) {
    std::vector<const link::MessageType*> types;
    for (const link::MessageType& type : protocol.messages)
      if (type.direction == direction && !type.starts) types.push_back(&type);
    return types;
  }

  const link::Protocol& protocol_;
  std::vector<const link::MessageType*> types_;
  EventsBetweenFrames events_;
};

}  // namespace

FaultType FrameUnsolicited() {
  return {.name = "frame.unsolicited",
          .summary = "Well-formed messages that no node of the flight sent.",
          .semantics =
              "Models a second sender on the line, or an attacker. Forged frames follow the frames that "
              "pass. They come as a Poisson process of `rate_hz` in the time of the flight. Those of one "
              "control period are sent, in the order of their times, directly behind the first frame of a "
              "later period, if the trigger picks that frame. They take time on the line. So the same ones "
              "follow a frame whether its sender computes fast or slowly. Nothing enters the line between "
              "frames: a receiver that has waited until then may have gone on already. Only what falls into "
              "the fault's active time counts, of a pause of more than a second only the last second, and "
              "nothing before the first frame. What would follow a frame that the trigger does not pick is "
              "left out. Each is a message of the protocol in this direction, all equally likely, other than "
              "one that starts the flight. Its values are drawn evenly from their plausible ranges, or up to "
              "10000 where these have no end. Every check of the receiver passes, except that a drawn "
              "sequence or time may be stale. If it is not, the messages behind it are.",
          .source =
              "ISO 26262-5:2018, Annex D (communication: insertion of messages, masquerading); IEC 61784-3 "
              "(insertion).",
          .parameters = {RateParameter("forged messages per second", 100.0)},
          .kind = WireKind{.wire_layer = WireLayer::kFrame,
                           .make = [](const WireSetup& setup) -> std::unique_ptr<WireModel> {
                             return std::make_unique<Unsolicited>(setup);
                           },
                           .remembers = true}};
}

}  // namespace tiltproof::faults
