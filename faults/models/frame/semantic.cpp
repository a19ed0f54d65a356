#include <algorithm>
#include <limits>
#include <optional>

#include "faults/fault_type.h"
#include "faults/frame_edit.h"
#include "faults/text.h"

namespace tiltproof::faults {
namespace {

double OutOfRange(const link::MessageField& field) { return field.max + (field.max - field.min); }

// True if a field can hold the value of that kind.
bool CanHold(const link::MessageField& field, std::string_view kind) {
  if (kind == "nan" || kind == "inf" || kind == "denormal") return !link::IsInteger(field.type);
  if (kind != "out_of_range") return true;
  return field.max < field.scale * link::LargestNumber(field.type);
}

std::optional<Problem> RefusesValue(const Parameters& parameters, const link::Protocol& protocol) {
  const std::string &name = parameters.Text("field"), &kind = parameters.Choice("kind");
  const link::MessageField* unable = nullptr;
  for (const link::MessageType& type : protocol.messages) {
    for (const link::MessageField& field : type.fields) {
      if (field.signal != name) continue;
      if (CanHold(field, kind)) return std::nullopt;
      unable = &field;
    }
  }
  if (unable == nullptr) return std::nullopt;  // a name that is unknown has its own message
  return Problem{
      "parameters.kind",
      Concat({"'", kind, "' is no value of ", name, ", which is sent as ", link::Name(unable->type),
              kind == "out_of_range" ? " with all its numbers in range" : "", " in the protocol '",
              protocol.name, "': use offset, sign_flip or stale"})};
}

class Semantic : public WireModel {
 public:
  explicit Semantic(const WireSetup& setup)
      : protocol_(setup.protocol),
        direction_(setup.direction),
        name_(setup.parameters.Text("field")),
        kind_(setup.parameters.Choice("kind")),
        value_(setup.parameters.Number("value")),
        probability_(setup.parameters.Number("probability")) {}

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    const bool replaces = context.random.Bernoulli(probability_);
    FrameEdit edit(*protocol_.framing, chunk.bytes);
    const std::optional<Place> place = edit.ok() ? PlaceIn(edit.payload()) : std::nullopt;
    if (place) {
      const double before = link::FieldValue(*place->type, edit.payload(), place->field);
      if (!replaces) {
        left_alone_ = before;
      } else {
        const link::MessageField& field = place->type->fields[place->field];
        link::SetFieldValue(*place->type, edit.payload(), place->field, Instead(before, field));
        const double after = link::FieldValue(*place->type, edit.payload(), place->field);
        edit.WriteTo(chunk.bytes);
        if (context.what != nullptr)
          context.Say(Concat({field.signal, " ", NumberText(before), " -> ", NumberText(after)}));
      }
    }
    out.push_back(std::move(chunk));
  }

  void Pass(link::Chunk&& chunk, std::vector<link::Chunk>& out) override {
    FrameEdit edit(*protocol_.framing, chunk.bytes);
    if (const auto place = edit.ok() ? PlaceIn(edit.payload()) : std::nullopt)
      left_alone_ = link::FieldValue(*place->type, edit.payload(), place->field);
    out.push_back(std::move(chunk));
  }

 private:
  struct Place {
    const link::MessageType* type;
    std::size_t field;  // its index
  };
  std::optional<Place> PlaceIn(std::span<const std::uint8_t> payload) const {
    const link::MessageType* type = protocol_.Classify(direction_, payload);
    if (type == nullptr) return std::nullopt;
    const auto found =
        std::find_if(type->fields.begin(), type->fields.end(),
                     [this](const link::MessageField& field) { return field.signal == name_; });
    if (found == type->fields.end()) return std::nullopt;
    return Place{type, static_cast<std::size_t>(found - type->fields.begin())};
  }

  double Instead(double before, const link::MessageField& field) const {
    using Limits = std::numeric_limits<double>;
    if (kind_ == "nan") return Limits::quiet_NaN();
    if (kind_ == "inf") return Limits::infinity();
    if (kind_ == "denormal")
      return field.type == link::NumberType::kF64
                 ? Limits::denorm_min()
                 : static_cast<double>(std::numeric_limits<float>::denorm_min());
    if (kind_ == "out_of_range") return OutOfRange(field);
    if (kind_ == "sign_flip") return -before;
    if (kind_ == "offset") return before + value_;
    return left_alone_.value_or(before);
  }

  const link::Protocol& protocol_;
  link::Direction direction_;
  std::string name_, kind_;
  double value_, probability_;
  std::optional<double> left_alone_;
};

}  // namespace

FaultType FrameSemantic() {
  return {
      .name = "frame.semantic",
      .summary = "A well-formed message with a wrong value.",
      .semantics =
          "Models a sender that computes nonsense and packs it well. With the given probability, one value "
          "of a message that the trigger picks is replaced. `nan` and `inf` send these numbers, `denormal` "
          "the smallest number above 0, `sign_flip` the negative value, and `offset` the value plus `value`. "
          "`out_of_range` sends the upper end of the field's plausible range plus the range's width. `stale` "
          "sends the field's value in the latest message with this field that this fault did not change, "
          "inside or outside the window. Without such a message nothing changes. The result is rounded to "
          "the "
          "field's type and scale; what an integer cannot hold becomes the end of its range. An integer has "
          "no `nan`, `inf` or `denormal`, and a field whose range is that of its type no `out_of_range`. The "
          "check is that of the new payload, and the frame is encoded again; if the check was wrong before, "
          "it stays wrong in the same bits. Messages without the field stay as they are. `message` chooses "
          "one of several that have it.",
      .source =
          "Cristian, Understanding Fault-tolerant Distributed Systems, Communications of the ACM 34(2), 1991 "
          "(value failures of a server).",
      .parameters = {{.name = "field",
                      .unit = "",
                      .kind = ParameterKind::kField,
                      .doc = "the value, by its signal's name in the table of messages: z_m, f_r_n, yaw_rad",
                      .example = "z_m"},
                     {.name = "kind",
                      .unit = "",
                      .kind = ParameterKind::kChoice,
                      .doc = "what is sent instead",
                      .example = "sign_flip",
                      .choices = {"nan", "inf", "denormal", "out_of_range", "sign_flip", "offset", "stale"}},
                     {.name = "value",
                      .unit = "of the field",
                      .min = -1e30,
                      .max = 1e30,
                      .doc = "what `offset` adds; the others do not use it",
                      .example = 1.0,
                      .default_value = 0.0},
                     ProbabilityParameter("probability, per frame, that the value is replaced", 0.3)},
      .kind = WireKind{.wire_layer = WireLayer::kFrame,
                       .make = [](const WireSetup& setup) -> std::unique_ptr<WireModel> {
                         return std::make_unique<Semantic>(setup);
                       },
                       .volume = Volume::kMayLose,  // fewer escapes
                       .remembers = true,
                       .refuses = RefusesValue}};
}

}  // namespace tiltproof::faults
