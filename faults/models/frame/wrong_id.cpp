#include <cmath>

#include "faults/fault_type.h"
#include "faults/frame_edit.h"
#include "faults/text.h"

namespace tiltproof::faults {
namespace {

// The type and the byte order of the protocol's ids.
link::MessageId IdsOf(const link::Protocol& protocol) {
  for (const link::MessageType& type : protocol.messages)
    if (type.id) return *type.id;
  return {};
}

class WrongId : public WireModel {
 public:
  explicit WrongId(const WireSetup& setup)
      : framing_(*setup.protocol.framing),
        probability_(setup.parameters.Number("probability")),
        id_(setup.parameters.Number("id")),
        as_(IdsOf(setup.protocol)) {}

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    FrameEdit edit(framing_, chunk.bytes);
    if (context.random.Bernoulli(probability_) && edit.ok() &&
        edit.payload().size() >= link::NumberBytes(as_.type)) {
      link::StoreNumber(as_.type, as_.order, id_, edit.payload());
      edit.WriteTo(chunk.bytes);
      if (context.what != nullptr)
        context.Say(Concat({"id ", NumberText(link::LoadNumber(as_.type, as_.order, edit.payload()))}));
    }
    out.push_back(std::move(chunk));
  }

 private:
  const link::Framing& framing_;
  double probability_, id_;
  link::MessageId as_;
};

std::optional<Problem> RefusesId(const Parameters& parameters, const link::Protocol& protocol) {
  const double id = parameters.Number("id");
  const link::NumberType type = IdsOf(protocol).type;
  const bool is_id = link::LeastNumber(type) <= id && id <= link::LargestNumber(type) &&
                     (!link::IsInteger(type) || id == std::floor(id));
  if (is_id) return std::nullopt;
  return Problem{"parameters.id",
                 Concat({"the ids of the protocol '", protocol.name, "' are ", link::Name(type),
                         ": must be a whole number from ", NumberText(link::LeastNumber(type)), " to ",
                         NumberText(link::LargestNumber(type))})};
}

}  // namespace

FaultType FrameWrongId() {
  return {
      .name = "frame.wrong_id",
      .summary = "A message comes with the id of another, or of none.",
      .semantics =
          "Models a sender with a wrong table of messages. With the given probability, the first bytes of "
          "the payload of a frame that the trigger picks become `id`. It is written as the protocol writes "
          "its ids, in `paper` as a binary32 number. A message with an id has it there. In a message without "
          "an id (in `paper` the replies and the references) its first bytes change. The check is that of "
          "the new payload, and the frame is encoded again; if the check was wrong before, it stays wrong in "
          "the same bits. With the id that the message has already, nothing changes.",
      .source =
          "Cristian, Understanding Fault-tolerant Distributed Systems, Communications of the ACM 34(2), "
          "1991 (value failures of a server).",
      .parameters = {{.name = "id",
                      .unit = "1",
                      .min = -3e38,
                      .max = 3e38,
                      .doc = "the id that is sent",
                      .example = 9.0},
                     ProbabilityParameter("probability, per frame, that it has the wrong id", 0.3)},
      .kind = WireKind{
          .wire_layer = WireLayer::kFrame,
          .make = [](const WireSetup& setup) -> std::unique_ptr<WireModel> {
            return std::make_unique<WrongId>(setup);
          },
          .volume = Volume::kMayLose,  // fewer escapes
          .refuses = RefusesId,
      }};
}

}  // namespace tiltproof::faults
