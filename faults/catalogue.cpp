// The fault catalogue: what CatalogueMarkdown() in faults/registry.h prints.
#include "faults/registry.h"
#include "faults/text.h"
#include "link/cobs_framing.h"
#include "link/hdlc_framing.h"
#include "link/length_framing.h"

namespace tiltproof::faults {
namespace {

// The page's first part: the rules that hold for all types.
constexpr const char* kPreamble = R"(# The fault catalogue

Written by `tiltproof faults`.

A fault acts in its window `[start_s, end_s)`:

- A fault on the wire acts on the frames whose first byte enters the wire in the window. Frames that the
  sender hands over before the server has accepted `start` are only in windows without `start_s`. The first
  sensor request is one of them.
- A fault on sensors acts on the samples in the window, before they are rounded to the protocol's types and
  sent.
- A fault on actuators acts in the plant's steps that begin in the window. It edits the command in force
  before the vehicle's limits are applied. The trigger decides about each command once: its answer holds until
  the next command takes effect.
- A fault of the firmware's receiver acts on each byte that arrives there in the window.
- A fault on a node, on the device or on a clock is a command. It is given at `start_s` and reverted at
  `end_s`. It has no target and no trigger. Nodes are processes only in real time.

"Needs" says what a fault requires of the client. A scenario is refused if its client cannot provide it.

A fault on frames means the same with every framing, where its text names none. Some need a part that not all
frames have: `check` and `run` refuse these for another framing.

FRAMINGS

A fault of the line or the receiver may act on a line between boards (docs/redundancy.md): `target` is then
the line's id, for both ways, or one way, `cross_to_a`. Without a `protocol`, nothing is known of the frames
on such a line. What a board gives to its transmitter at once stands in the place of a frame. Faults on the
content of frames are refused there: all `frame.` faults but frame.delay.

The trigger decides on which frames, samples or bytes in the window the fault acts. If the fault has a
`message`, only frames of that kind count. The trigger picks every `every_nth_count`-th of them, with
`probability`. On the wire, faults act in the order of their stages: frame, byte, timing. Within a stage, they
act in the order of the file.

The frames as they were sent determine which of them a fault picks and what it draws for each. At the
receiver, the bytes as they arrived determine this. Adding or removing a fault therefore never shifts the
draws of another. Only what a fault remembers comes from the frames that reach it. These are the state of
wire.gilbert_elliott, the queue of wire.bandwidth_cap, the frames of frame.reorder and frame.replay_stale, and
the value that frame.semantic keeps. The models frame.flag_loss, frame.unsolicited and frame.babble count from
the frame before.

An occasion on which the fault changed nothing does not count as an activation.

"Severity" is what `margin` and `envelope` vary: a parameter, from the value at which the fault changes
nothing, on the scale on which they search. Where no parameter measures it, it is the length of the window,
`end_s` - `start_s`. What happens at one instant has none. "Source" says where the model, or the failure that
it stands for, is described.
)";

// Prose in lines of at most 110 characters, without blank or line break at the end.
std::string Wrapped(std::string_view text) {
  constexpr std::size_t kColumnsMax = 110;
  std::string lines;
  while (text.size() > kColumnsMax) {
    const std::size_t blank = text.rfind(' ', kColumnsMax);
    if (blank == std::string_view::npos) break;
    lines += Concat({text.substr(0, blank), "\n"});
    text.remove_prefix(blank + 1);
  }
  return Concat({lines, text});
}

std::string ValueText(const ParameterValue& value) {
  if (const auto* number = std::get_if<double>(&value)) return NumberText(*number);
  if (const auto* v = std::get_if<std::array<double, 3>>(&value))
    return Concat({"[", NumberText((*v)[0]), ", ", NumberText((*v)[1]), ", ", NumberText((*v)[2]), "]"});
  return std::get<std::string>(value);
}

std::string AllowedText(const ParameterInfo& info) {
  if (info.kind == ParameterKind::kChoice) return Joined(info.choices);
  if (info.kind == ParameterKind::kSensor) return "a sensor of the vehicle";
  if (info.kind == ParameterKind::kSensorOrAll) return "a sensor of the vehicle, or `all`";
  if (info.kind == ParameterKind::kPositionSensor) return "a position sensor of the vehicle";
  if (info.kind == ParameterKind::kSensorVector)
    return "three sensors of the vehicle, by their vector's name";
  if (info.kind == ParameterKind::kInput) return "an input of the vehicle, without its unit";
  if (info.kind == ParameterKind::kFrameWords) return "words of hexadecimal digits, or `-`";
  if (info.kind == ParameterKind::kField) return "a field of a message";
  if (info.kind == ParameterKind::kRotor) return "a rotor of the vehicle";
  if (info.kind == ParameterKind::kJoint) return "a joint of the vehicle that a servo turns";
  if (info.kind == ParameterKind::kText)
    return Concat({"text of 1 to ", std::to_string(kParameterTextMax), " printable characters"});
  if (info.kind == ParameterKind::kVector)
    return Concat({"[x, y, z], each ", NumberText(info.min), " to ", NumberText(info.max)});
  const std::string_view whole = info.kind == ParameterKind::kInteger ? ", whole" : "";
  return Concat({NumberText(info.min), " to ", NumberText(info.max), whole});
}

std::string WindowText(const FaultType& type) {
  const auto bound = [](std::string_view key, Bound how) {
    return how == Bound::kRequired  ? Concat({"`", key, "` required"})
           : how == Bound::kRefused ? Concat({"no `", key, "`"})
                                    : Concat({"`", key, "` optional"});
  };
  return Concat({"Window: ", bound("start_s", type.start), ", ", bound("end_s", type.end), "."});
}

std::string NeedsText(Needs needs) {
  switch (needs) {
    case Needs::kNothing:
      return "";
    case Needs::kNodes:
      return " Needs real time.";
    case Needs::kReset:
      return " Needs a client that can be reset: an emulated board or, in lockstep, a library.";
    case Needs::kTask:
      return " Needs a library or an emulated board, in lockstep.";
    case Needs::kComputing:
      return " Needs a library or a program that states its computing time, in lockstep.";
    case Needs::kProcessor:
      return " Needs an emulated board.";
    case Needs::kEmulation:
      return " Needs an emulated board in lockstep.";
    case Needs::kClock:
      return " Needs, for the client, a library or, in lockstep, an emulated board; for other nodes, real "
             "time.";
    case Needs::kClockJump:
      return " Needs, for the client, a library; for other nodes, real time.";
  }
  return "";
}

struct KnownFraming {
  std::shared_ptr<const link::Framing> framing;
  std::string_view frame;  // what it looks like on the line
};
const std::vector<KnownFraming>& KnownFramings() {
  static const std::vector<KnownFraming> kFramings = {
      {link::MakeHdlcFraming(link::CheckKind::kFletcher16),
       "flag 7E, payload and check with 7D before each 7E and 7D in them, flag 7E"},
      {link::MakeCobsFraming(link::CheckKind::kCrc16Ibm3740),
       "payload and check with codes in place of each 00, flag 00"},
      {link::MakeLengthFraming({.sync = {0xAA, 0x55}}, link::CheckKind::kCrc16Ibm3740),
       "1 to 4 marks, the length of the payload, payload and check"}};
  return kFramings;
}

std::string FramingsText(link::ByteRole role) {
  std::vector<std::string_view> names;
  for (const auto& [framing, frame] : KnownFramings())
    if (framing->Has(role)) names.push_back(framing->name());
  return Concat({" Only with the framing ", Joined(names), "."});
}

std::string FramingsMarkdown() {
  std::string text = "| framing | a frame on the line | faults that do not apply |\n|---|---|---|\n";
  for (const auto& [framing, frame] : KnownFramings()) {
    std::string names;
    for (const FaultType& type : FaultTypes()) {
      const auto* wire = type.As<WireKind>();
      if (wire != nullptr && wire->needs_role && !framing->Has(*wire->needs_role))
        names += Concat({names.empty() ? "" : ", ", "`", type.name, "`"});
    }
    text += Concat({"| `", framing->name(), "` | ", frame, " | ", names, " |\n"});
  }
  return text;
}

std::string TargetMarkdown(const FaultType& type) {
  if (type.is_command())
    return Concat(
        {Wrapped(Concat({"No target, no trigger. ", WindowText(type), NeedsText(type.needs)})), "\n\n"});
  if (type.IsOneOf<SensorKind>()) return "No target. Edits sensor values.\n\n";
  if (type.IsOneOf<ActuatorKind>()) return "No target. Edits actuator values.\n\n";
  if (type.IsOneOf<PlantKind>()) return "No target. Disturbs the vehicle itself.\n\n";
  const auto* wire = type.As<WireKind>();
  std::vector<std::string_view> names;
  for (const Target target : AcceptedTargets(type)) {
    if (target != Target::kNone) names.push_back(Name(target));
  }
  const std::string without =
      type.default_target() ? Concat({"; ", Name(*type.default_target()), " when not stated"}) : "";
  return Concat({"Target: ", Joined(names), without, ". Stage: ",
                 wire != nullptr ? Name(wire->wire_layer) : "receiver", ".", NeedsText(type.needs),
                 wire != nullptr && wire->needs_role ? FramingsText(*wire->needs_role) : "", "\n\n"});
}

std::string ParametersMarkdown(const FaultType& type) {
  if (type.parameters.empty()) return "No parameters.\n\n";
  std::string text = "| parameter | unit | allowed | default | meaning |\n|---|---|---|---|---|\n";
  std::string zeros;
  for (const ParameterInfo& info : type.parameters) {
    text += Concat({"| `", info.name, "` | ", info.unit.empty() ? "-" : info.unit, " | ", AllowedText(info),
                    " | ", info.default_value ? ValueText(*info.default_value) : "required", " | ", info.doc,
                    " |\n"});
    if (info.zero)
      zeros += Concat({zeros.empty() ? "" : ", ", "`", info.name, ": ", ValueText(*info.zero), "`"});
  }
  text += "\n";
  if (!zeros.empty()) text += Concat({"Changes nothing with ", zeros, ".\n\n"});
  return text;
}

std::string SeverityText(const FaultType& type) {
  if (type.has_no_severity) return "none: no number measures it.";
  if (!type.has_severity()) return "none: it happens at one instant.";
  const ParameterInfo* info = type.severity_parameter();
  if (info == nullptr) return "the length of the window, from 0 s (harmless), on a logarithmic scale.";
  if (info->severity)
    return Concat({"`", info->name, "`, from ", ValueText(*info->zero), " (harmless), on a ",
                   *info->severity == Scale::kLinear ? "linear" : "logarithmic", " scale."});
  return Concat({"the length of the window, `", info->name, "`, from ", NumberText(info->min),
                 type.asks_restart() ? " (not harmless: the restart itself remains)" : "",
                 ", on a logarithmic scale."});
}

std::string SourceMarkdown(const FaultType& type) {
  return Concat({Wrapped(Concat({"Source: ", type.source})), "\n\n"});
}

std::string ExampleYaml(const FaultType& type) {
  std::string text = Concat({"- {id: example, type: ", type.name});
  if (type.has_target()) text += ", target: to_client";
  if (type.start != Bound::kRefused) text += ", start_s: 20";
  if (type.end != Bound::kRefused) text += ", end_s: 25";
  std::string parameters;
  for (const ParameterInfo& info : type.parameters) {
    parameters += Concat({parameters.empty() ? "" : ", ", info.name, ": ", ValueText(info.example)});
  }
  return parameters.empty() ? Concat({text, "}"}) : Concat({text, ", parameters: {", parameters, "}}"});
}

}  // namespace

std::string ParameterText(const ParameterInfo& info) {
  const bool has_unit = !info.unit.empty() && info.unit != "1";
  const std::string_view in = !has_unit ? "" : info.unit.starts_with("of ") ? "in the unit " : "in ";
  std::string text =
      Concat({info.doc, "; ", in, has_unit ? info.unit : "", has_unit ? ", " : "", AllowedText(info)});
  if (info.default_value) text += Concat({"; ", ValueText(*info.default_value), " when not stated"});
  if (info.severity) text += Concat({"; harmless at ", ValueText(*info.zero)});
  return text;
}

std::string CatalogueMarkdown() {
  std::string text = kPreamble;
  constexpr std::string_view kFramings = "FRAMINGS\n";
  text.replace(text.find(kFramings), kFramings.size(), FramingsMarkdown());
  for (const FaultType& type : FaultTypes()) text += Concat({"\n", Markdown(type)});
  return text;
}

std::string Markdown(const FaultType& type) {
  return Concat({"## ", type.name, "\n\n", Wrapped(Concat({type.summary, " ", type.semantics})), "\n\n",
                 TargetMarkdown(type), ParametersMarkdown(type),
                 Wrapped(Concat({"Severity: ", SeverityText(type)})), "\n\n", SourceMarkdown(type),
                 "```yaml\n", ExampleYaml(type), "\n```\n"});
}

}  // namespace tiltproof::faults
