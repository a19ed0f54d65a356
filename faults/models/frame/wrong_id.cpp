#include "faults/fault_type.h"
#include "faults/frame_edit.h"
#include "faults/text.h"

namespace tiltproof::faults {
namespace {

class WrongId : public WireModel {
 public:
  explicit WrongId(const WireSetup& setup)
      : framing_(*setup.protocol.framing),
        probability_(setup.parameters.Number("probability")),
        id_(static_cast<float>(setup.parameters.Number("id"))) {}

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    FrameEdit edit(framing_, chunk.bytes);
    if (context.random.Bernoulli(probability_) && edit.ok() && edit.payload().size() >= 4) {
      SetFloat(edit.payload(), 0, id_);
      edit.WriteTo(chunk.bytes);
      if (context.what != nullptr) context.Say(Concat({"id ", NumberText(static_cast<double>(id_))}));
    }
    out.push_back(std::move(chunk));
  }

 private:
  const link::Framing& framing_;
  double probability_;
  float id_;
};

}  // namespace

FaultType FrameWrongId() {
  return {.name = "frame.wrong_id",
          .summary = "A message comes with the id of another, or of none.",
          .semantics =
              "Models a sender with a wrong table of messages. With the given probability, the first four "
              "bytes of the payload of a frame that the trigger picks become `id`, as a binary32 number. A "
              "client's message has its id there. In a message without an id (the replies and the "
              "references) they are its first value. The checksum is that of the new payload, and bytes are "
              "escaped again; if the checksum was wrong before, it stays wrong in the same bits. With the id "
              "that the message has already, nothing changes.",
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
              .volume = Volume::kMayLose  // fewer escapes
          }};
}

}  // namespace tiltproof::faults
