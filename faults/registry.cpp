#include "faults/registry.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>
#include <unordered_map>
#include <utility>

#include "faults/frame_words.h"
#include "faults/nearest_name.h"
#include "faults/signal_choice.h"
#include "faults/text.h"

namespace tiltproof::faults {

// One line per type: the function that describes it, defined in faults/models/<layer>/<name>.cpp.
#define TILTPROOF_FAULT_TYPES(FAULT) \
  FAULT(WireBitError)                \
  FAULT(WireGilbertElliott)          \
  FAULT(WireBurst)                   \
  FAULT(WireStuckByte)               \
  FAULT(WireByteDrop)                \
  FAULT(WireByteInsert)              \
  FAULT(WireByteDuplicate)           \
  FAULT(WireBreak)                   \
  FAULT(WireStuckAt)                 \
  FAULT(WireBaudMismatch)            \
  FAULT(WireByteSwap)                \
  FAULT(WireChunking)                \
  FAULT(WireBandwidthCap)            \
  FAULT(WireTerminal)                \
  FAULT(WireEcho)                    \
  FAULT(FrameDrop)                   \
  FAULT(FrameDuplicate)              \
  FAULT(FrameTruncate)               \
  FAULT(FrameDelay)                  \
  FAULT(FrameReorder)                \
  FAULT(FrameReplayStale)            \
  FAULT(FrameFlagLoss)               \
  FAULT(FrameFlagForgery)            \
  FAULT(FrameDanglingEscape)         \
  FAULT(FrameLengthError)            \
  FAULT(FrameShort)                  \
  FAULT(FrameLong)                   \
  FAULT(FrameWrongId)                \
  FAULT(FrameChecksumPreserving)     \
  FAULT(FrameSemantic)               \
  FAULT(FrameUnsolicited)            \
  FAULT(FrameBabble)                 \
  FAULT(FrameScript)                 \
  FAULT(LinkSilence)                 \
  FAULT(LinkDisconnect)              \
  FAULT(SensorBias)                  \
  FAULT(SensorFreeze)                \
  FAULT(SensorNoise)                 \
  FAULT(SensorRandomWalk)            \
  FAULT(SensorDrift)                 \
  FAULT(SensorScale)                 \
  FAULT(SensorStuckAt)               \
  FAULT(SensorDropout)               \
  FAULT(SensorGarbage)               \
  FAULT(SensorQuantise)              \
  FAULT(SensorSaturate)              \
  FAULT(SensorSpike)                 \
  FAULT(SensorRateDrop)              \
  FAULT(SensorDelay)                 \
  FAULT(SensorSwap)                  \
  FAULT(SensorSignFlip)              \
  FAULT(SensorMisalignment)          \
  FAULT(SensorSpoof)                 \
  FAULT(ActuatorLossOfEffectiveness) \
  FAULT(ActuatorRateLimit)           \
  FAULT(ActuatorLockInPlace)         \
  FAULT(ActuatorFloat)               \
  FAULT(ActuatorHardOver)            \
  FAULT(ActuatorOffset)              \
  FAULT(ActuatorDeadband)            \
  FAULT(ActuatorBacklash)            \
  FAULT(ActuatorLag)                 \
  FAULT(ActuatorDelay)               \
  FAULT(ActuatorOscillation)         \
  FAULT(ActuatorNoise)               \
  FAULT(PlantForce)                  \
  FAULT(PlantTorque)                 \
  FAULT(PlantWind)                   \
  FAULT(PlantGust)                   \
  FAULT(PlantTurbulence)             \
  FAULT(PlantMass)                   \
  FAULT(PlantComShift)               \
  FAULT(PlantInertia)                \
  FAULT(PlantThrust)                 \
  FAULT(PlantServoJam)               \
  FAULT(PlantServoRunaway)           \
  FAULT(PlantBatterySag)             \
  FAULT(NodeKill)                    \
  FAULT(NodePause)                   \
  FAULT(NodeRestart)                 \
  FAULT(DdsPartition)                \
  FAULT(DdsLoss)                     \
  FAULT(ClockDrift)                  \
  FAULT(ClockJump)                   \
  FAULT(DeviceReset)                 \
  FAULT(DeviceWatchdogReset)         \
  FAULT(DeviceHang)                  \
  FAULT(DeviceStall)                 \
  FAULT(DeviceTaskDelay)             \
  FAULT(DeviceSlowCpu)               \
  FAULT(DeviceBitFlip)               \
  FAULT(UartOverrun)                 \
  FAULT(UartFramingError)            \
  FAULT(UartNoiseError)              \
  FAULT(HarnessNull)                 \
  FAULT(HarnessCanary)

#define TILTPROOF_DECLARE(function) FaultType function();
#define TILTPROOF_CALL(function) function(),
TILTPROOF_FAULT_TYPES(TILTPROOF_DECLARE)

namespace {

// "; did you mean 'x'?", or all names when none is near.
std::string Suggestion(std::string_view name, const std::vector<std::string_view>& candidates) {
  const std::string_view nearest = NearestName(name, candidates);
  if (!nearest.empty()) return Concat({"; did you mean '", nearest, "'?"});
  return Concat({"; known: ", Joined(candidates)});
}

bool IsParameterText(std::string_view text) {
  const auto is_printable = [](char c) { return c >= ' ' && c <= '~'; };
  return !text.empty() && text.size() <= kParameterTextMax && text.front() != ' ' && text.back() != ' ' &&
         std::all_of(text.begin(), text.end(), is_printable);
}

struct FormerType {
  std::string_view name, why;
};
constexpr FormerType kFormerTypes[] = {
    {"clock.skew", "was replaced by clock.drift {node, ppm} and clock.jump {node, jump_ms}"},
    {"device.clock_drift", "was replaced by clock.drift {ppm}"},
    {"uart.parity_error", "was removed: set link.parity, and flip bits with wire.bit_error"},
};

// Largest number of commands of one fault: one in every control period of four minutes.
constexpr TimeNs kCommandsMax = 20'000;

class Validator {
 public:
  explicit Validator(const FaultSpec& spec) : spec_(spec) {}

  std::vector<Problem> Run() {
    CheckWindowAndTrigger();
    const FaultType* type = FindFaultType(spec_.type);
    if (type == nullptr) {
      std::vector<std::string_view> names;
      for (const FaultType& known : FaultTypes()) names.push_back(known.name);
      if (const std::string_view why = WhyNoLonger(spec_.type); !why.empty())
        Add("type", {"'", spec_.type, "' ", why});
      else
        Add("type", {"unknown fault type '", spec_.type, "'", Suggestion(spec_.type, names)});
      return std::move(problems_);
    }
    CheckBound(*type, "start_s", type->start, spec_.start_ns != kPowerOn);
    CheckBound(*type, "end_s", type->end, spec_.end_ns != kNever);
    CheckPeriod(*type);
    CheckWaiting(*type);
    if (type->is_command()) CheckCommand(*type);
    CheckTarget(*type);
    CheckMessage(*type);
    CheckParameters(*type);
    return std::move(problems_);
  }

 private:
  void Add(std::string_view key, std::initializer_list<std::string_view> message) {
    problems_.push_back({std::string(key), Concat(message)});
  }

  void CheckWindowAndTrigger() {
    if (spec_.id.empty()) Add("id", {"must not be empty"});
    if (spec_.end_ns <= spec_.start_ns) Add("end_s", {"the window must end after it begins"});
    if (spec_.every_nth_count < 1) Add("every_nth_count", {"must be at least 1"});
    if (!(spec_.probability >= 0.0 && spec_.probability <= 1.0))
      Add("probability", {"must be between 0 and 1"});
  }

  void CheckBound(const FaultType& type, std::string_view key, Bound bound, bool stated) {
    if (bound == Bound::kRequired && !stated) Add(key, {type.name, " needs ", key});
    if (bound == Bound::kRefused && stated) Add(key, {type.name, " takes no ", key});
  }

  void CheckWaiting(const FaultType& type) {
    if (spec_.when.empty() && spec_.edge != Edge::kLevel) Add("edge", {"needs when, whose edge it is"});
    if (spec_.after && spec_.after->fault == spec_.id) Add("after.fault", {"a fault cannot wait for itself"});
    if (spec_.after && spec_.after->delay_ns < 0) Add("after.delay_s", {"must be at least 0"});
    if (!type.is_command()) return;
    if (!spec_.when.empty())
      Add("when", {type.name, " is a command, planned before the flight: it takes no when"});
    if (spec_.after) Add("after", {type.name, " is a command, planned before the flight: it takes no after"});
  }

  void CheckPeriod(const FaultType& type) {
    if (spec_.period_ns == kNever) {
      if (spec_.duty) Add("duty", {"needs period_s, of which it is a part"});
      return;
    }
    if (spec_.period_ns <= 0) Add("period_s", {"must be more than 0"});
    if (!spec_.duty)
      Add("period_s", {"needs duty: the part of each period in which the fault is active"});
    else if (!(*spec_.duty > 0.0 && *spec_.duty <= 1.0))
      Add("duty", {"must be more than 0 and at most 1"});
    if (spec_.start_ns == kPowerOn && !spec_.after)
      Add("period_s", {"needs start_s, from which the periods are counted"});
    if (type.is_command()) CheckPeriodOfCommand(type);
  }

  // It is given again in every period, so it must be reverted before.
  void CheckPeriodOfCommand(const FaultType& type) {
    if (type.happens_once()) {
      Add("period_s", {type.name, " happens once: add a fault for each further time"});
    } else if (spec_.end_ns == kNever) {
      Add("period_s", {"needs end_s: a command is planned for each period before the flight"});
    } else if (spec_.period_ns > 0 && spec_.end_ns > spec_.start_ns && spec_.start_ns != kPowerOn &&
               (spec_.end_ns - spec_.start_ns) / spec_.period_ns >= kCommandsMax) {
      Add("period_s", {"makes more than ", std::to_string(kCommandsMax), " commands"});
    }
  }

  // A command is given at a time, whatever passes.
  void CheckCommand(const FaultType& type) {
    if (spec_.start_ns != kPowerOn && spec_.start_ns < 0) Add("start_s", {"must be at least 0"});
    if (spec_.every_nth_count != 1) Add("every_nth_count", {type.name, " takes no every_nth_count"});
    if (spec_.probability != 1.0)
      Add("probability", {type.name, " takes no probability in addition to its parameters"});
  }

  void CheckTarget(const FaultType& type) {
    if (!spec_.line.empty() && type.has_target()) {
      if (spec_.target == Target::kNone) AddUnknownTarget(type);
      return;
    }
    const std::vector<Target> accepted = AcceptedTargets(type);
    if (std::find(accepted.begin(), accepted.end(), spec_.target) != accepted.end()) return;
    if (!type.has_target()) {
      Add("target", {type.name, " takes no target"});
      return;
    }
    std::vector<std::string_view> names;
    names.reserve(accepted.size());
    for (const Target target : accepted) names.push_back(Name(target));
    Add("target", {type.name, " needs a target: ", Joined(names)});
  }

  void AddUnknownTarget(const FaultType& type) {
    std::vector<std::string_view> names;
    for (const Target target : AcceptedTargets(type))
      if (target != Target::kNone) names.push_back(Name(target));
    Add("target", {"unknown value '", spec_.line, "'", Suggestion(spec_.line, names)});
  }

  void CheckMessage(const FaultType& type) {
    if (!spec_.message.empty() && !type.IsOneOf<WireKind>())
      Add("message", {type.name, " acts on no frames: it takes no message"});
  }

  void CheckParameters(const FaultType& type) {
    std::vector<std::string_view> names;
    for (const ParameterInfo& info : type.parameters) names.push_back(info.name);
    for (const auto& [name, value] : spec_.parameters) {
      const auto known = std::find(names.begin(), names.end(), name);
      if (known == names.end()) {
        Add("parameters." + name, {"unknown parameter '", name, "' of ", type.name,
                                   names.empty() ? ", which takes none" : Suggestion(name, names)});
      } else {
        CheckValue(type.parameters[static_cast<std::size_t>(known - names.begin())], value);
      }
    }
    for (const ParameterInfo& info : type.parameters) {
      if (info.default_value || spec_.parameters.contains(std::string(info.name))) continue;
      Add("parameters", {type.name, " needs the parameter '", info.name, "' (", info.doc, ")"});
    }
  }

  void CheckValue(const ParameterInfo& info, const ParameterValue& value) {
    const std::string key = Concat({"parameters.", info.name});
    if (info.kind == ParameterKind::kChoice) {
      const auto* text = std::get_if<std::string>(&value);
      if (text == nullptr) {
        Add(key, {"'", info.name, "' must be one of ", Joined(info.choices)});
      } else if (std::find(info.choices.begin(), info.choices.end(), *text) == info.choices.end()) {
        Add(key, {"unknown ", info.name, " '", *text, "'", Suggestion(*text, info.choices)});
      }
      return;
    }
    if (NamesSignal(info.kind)) {
      const auto* text = std::get_if<std::string>(&value);
      if (text == nullptr || !IsSignalName(*text))
        Add(key, {"'", info.name, "' must be the name of a signal: letters, digits and '_'"});
      return;
    }
    if (info.kind == ParameterKind::kText || info.kind == ParameterKind::kField || NamesPart(info.kind)) {
      const auto* text = std::get_if<std::string>(&value);
      if (text == nullptr || !IsParameterText(*text))
        Add(key, {"'", info.name, "' must be a text of 1 to ", std::to_string(kParameterTextMax),
                  " printable ASCII characters, without blanks at its ends"});
      return;
    }
    if (info.kind == ParameterKind::kFrameWords) {
      const auto* text = std::get_if<std::string>(&value);
      if (text == nullptr || text->size() > kFrameWordsTextMax)
        Add(key, {"'", info.name, "' must be a text of at most ", std::to_string(kFrameWordsTextMax),
                  " characters"});
      else if (const std::string problem = ReadFrameWords(*text).problem; !problem.empty())
        Add(key, {problem});
      return;
    }
    if (info.kind == ParameterKind::kVector) {
      const auto* vector = std::get_if<std::array<double, 3>>(&value);
      const auto in_range = [&](double part) { return part >= info.min && part <= info.max; };
      if (vector == nullptr || !std::all_of(vector->begin(), vector->end(), in_range))
        Add(key, {"'", info.name, "' must be three numbers [x, y, z], each between ", NumberText(info.min),
                  " and ", NumberText(info.max)});
      else if (*vector == std::array<double, 3>{})
        Add(key, {"'", info.name, "' must not be all zero: it is a direction"});
      return;
    }
    const auto* number = std::get_if<double>(&value);
    if (number == nullptr || !std::isfinite(*number)) {
      Add(key, {"'", info.name, "' must be a finite number"});
    } else if (info.kind == ParameterKind::kInteger && *number != std::floor(*number)) {
      Add(key, {"'", info.name, "' must be a whole number"});
    } else if (*number < info.min || *number > info.max) {
      Add(key, {"'", info.name, "' must be between ", NumberText(info.min), " and ", NumberText(info.max)});
    }
  }

  const FaultSpec& spec_;
  std::vector<Problem> problems_;
};

}  // namespace

std::string_view Name(ReceiveMark mark) {
  switch (mark) {
    case ReceiveMark::kNone:
      return "none";
    case ReceiveMark::kOverrun:
      return "overrun";
    case ReceiveMark::kFraming:
      return "framing error";
    case ReceiveMark::kParity:
      return "parity_error";
    case ReceiveMark::kNoise:
      return "noise error";
  }
  return "unknown";
}

const std::vector<FaultType>& FaultTypes() {
  static const std::vector<FaultType> types = {TILTPROOF_FAULT_TYPES(TILTPROOF_CALL)};
  return types;
}

const FaultType* FindFaultType(std::string_view name) {
  static const auto by_name = [] {
    std::unordered_map<std::string_view, const FaultType*> types;
    for (const FaultType& type : FaultTypes()) types.emplace(type.name, &type);
    return types;
  }();
  const auto found = by_name.find(name);
  return found == by_name.end() ? nullptr : found->second;
}

std::string_view WhyNoLonger(std::string_view name) {
  for (const FormerType& former : kFormerTypes) {
    if (former.name == name) return former.why;
  }
  return {};
}

namespace {

std::string_view TextOf(link::ByteRole role) {
  switch (role) {
    case link::ByteRole::kFlagByte:
      return "a flag at their end";
    case link::ByteRole::kEscapeByte:
      return "escaped bytes";
    case link::ByteRole::kLength:
      return "a length in front";
    default:
      return link::Name(role);
  }
}

// The faults on parts of a frame that this framing has, and one that needs no part.
std::string AlternativesIn(const link::Framing& framing) {
  std::vector<std::string_view> names;
  for (const FaultType& type : FaultTypes()) {
    const auto* wire = type.As<WireKind>();
    if (wire != nullptr && wire->needs_role && framing.Has(*wire->needs_role)) names.push_back(type.name);
  }
  names.emplace_back("frame.truncate");
  return Joined(names);
}

}  // namespace

std::optional<Problem> ProtocolProblem(const FaultSpec& spec, const link::Protocol& protocol) {
  const FaultType& type = ValidType(spec);
  const auto* wire = type.As<WireKind>();
  if (wire == nullptr) return std::nullopt;
  const link::Framing& framing = *protocol.framing;
  if (wire->needs_role && !framing.Has(*wire->needs_role))
    return Problem{"type", Concat({type.name, " needs frames with ", TextOf(*wire->needs_role),
                                   "; the protocol '", protocol.name, "' has the framing '", framing.name(),
                                   "' without: use one of ", AlternativesIn(framing)})};
  return wire->refuses == nullptr ? std::nullopt : wire->refuses(ResolvedParameters(spec, type), protocol);
}

bool Reaches(Target target, link::Direction direction) {
  switch (target) {
    case Target::kToClient:
      return direction == link::Direction::kToClient;
    case Target::kToPlant:
      return direction == link::Direction::kToPlant;
    case Target::kBoth:
      return direction != link::Direction::kReference;
    case Target::kReference:
      return direction == link::Direction::kReference;
    case Target::kNone:
      return false;
  }
  return false;
}

const link::MessageType* FindMessage(const link::Protocol& protocol, std::string_view name) {
  const bool has_reply = protocol.Find(link::MessageKind::kReply) != nullptr;
  const link::MessageType* in_role = nullptr;
  bool several = false;
  const std::string_view role = name == "sensors" ? link::Name(link::MessageKind::kRequest) : name;
  for (const link::MessageType& type : protocol.messages) {
    if (type.name == name) return &type;
    const bool is_reply = !has_reply && type.kind == link::MessageKind::kStreamed && role == "reply";
    if (!is_reply && link::Name(type.kind) != role) continue;
    several = in_role != nullptr;
    in_role = &type;
  }
  return several ? nullptr : in_role;
}

std::string MessageProblem(const FaultSpec& spec, const FaultType& type, const link::Protocol& protocol) {
  if (spec.message.empty() || !type.IsOneOf<WireKind>()) return {};
  const Target target = ResolvedTarget(spec, type);
  std::vector<std::string_view> names;
  for (const link::MessageType& message : protocol.messages)
    if (Reaches(target, message.direction)) names.push_back(message.name);
  const link::MessageType* message = FindMessage(protocol, spec.message);
  if (message == nullptr)
    return Concat({"the protocol '", protocol.name, "' has no message '", spec.message, "'",
                   Suggestion(spec.message, names)});
  if (Reaches(target, message->direction)) return {};
  return Concat({"'", message->name, "' does not travel there (target ", Name(target),
                 "); what does: ", Joined(names)});
}

std::vector<std::string> FieldNames(const link::Protocol& protocol, Target target, std::string_view message) {
  const link::MessageType* only = FindMessage(protocol, message);
  std::vector<std::string> names;
  for (const link::MessageType& type : protocol.messages) {
    if (!Reaches(target, type.direction) || (only != nullptr && only != &type)) continue;
    for (const link::MessageField& field : type.fields)
      if (std::find(names.begin(), names.end(), field.signal) == names.end()) names.push_back(field.signal);
  }
  return names;
}

std::optional<std::string> LineProblem(const FaultType& type, bool has_protocol) {
  const auto* wire = type.As<WireKind>();
  const bool edits_frames =
      wire != nullptr && wire->wire_layer == WireLayer::kFrame && type.name.starts_with("frame.");
  if (has_protocol || !edits_frames) return std::nullopt;
  return Concat(
      {type.name, " acts on whole frames, and the line carries bytes as they are: name its `protocol`"});
}

std::vector<Target> AcceptedTargets(const FaultType& type) {
  if (!type.has_target()) return {Target::kNone};
  std::vector<Target> targets = {Target::kToClient, Target::kToPlant, Target::kBoth, Target::kReference};
  // The lines that end at the firmware.
  if (type.IsOneOf<ReceiverKind>()) targets = {Target::kToClient, Target::kReference};
  const auto* wire = type.As<WireKind>();
  if (wire != nullptr && wire->sends_back) targets.pop_back();  // the reference line has no way back
  if (type.default_target()) targets.push_back(Target::kNone);
  return targets;
}

Target ResolvedTarget(const FaultSpec& spec, const FaultType& type) {
  return spec.target == Target::kNone ? type.default_target().value_or(Target::kNone) : spec.target;
}

Parameters ResolvedParameters(const FaultSpec& spec, const FaultType& type) {
  std::map<std::string, ParameterValue, std::less<>> values(spec.parameters.begin(), spec.parameters.end());
  for (const ParameterInfo& info : type.parameters) {
    if (info.default_value) values.try_emplace(std::string(info.name), *info.default_value);
  }
  return Parameters(std::move(values));
}

Window WindowOf(const FaultSpec& spec) {
  Window window{spec.start_ns, spec.end_ns};
  const FaultType* type = FindFaultType(spec.type);
  if (type != nullptr && !type->duration_ms.empty())
    window.end_ns =
        spec.start_ns + FromSeconds(ResolvedParameters(spec, *type).Number(type->duration_ms) * 1e-3);
  return window;
}

std::vector<Problem> Validate(const FaultSpec& spec) { return Validator(spec).Run(); }

const FaultType& ValidType(const FaultSpec& spec) {
  const std::vector<Problem> problems = Validate(spec);
  if (!problems.empty())
    throw std::invalid_argument(
        Concat({"fault '", spec.id, "', ", problems[0].key, ": ", problems[0].message}));
  return *FindFaultType(spec.type);
}

}  // namespace tiltproof::faults
