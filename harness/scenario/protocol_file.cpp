#include "harness/scenario/protocol_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include "harness/scenario/diagnostic.h"
#include "harness/scenario/did_you_mean.h"
#include "harness/scenario/mapping_reader.h"
#include "harness/scenario/shipped_protocols.h"
#include "link/cobs_framing.h"
#include "link/hdlc_framing.h"
#include "link/length_framing.h"

namespace tiltproof::harness {
namespace {

using link::Direction;
using link::FieldContent;
using link::MessageField;
using link::MessageKind;
using link::MessageType;
using link::NumberType;

constexpr std::size_t kMessagesMax = 128;
constexpr double kShareMagnitude = 10;   // a plausible share of a thrust
constexpr double kMagnitudeMax = 1e308;  // the largest that `min` and `max` take
constexpr std::string_view kSequence = "sequence", kTimeUs = "time_us";

FieldContent ContentOf(std::string_view signal) {
  if (signal == kSequence) return FieldContent::kSequence;
  return signal == kTimeUs ? FieldContent::kTimeUs : FieldContent::kSignal;
}

std::shared_ptr<const link::Framing> FramingOf(const ProtocolSpec& spec) {
  switch (spec.framing) {
    case FramingType::kHdlc:
      return link::MakeHdlcFraming(spec.check);
    case FramingType::kCobs:
      return link::MakeCobsFraming(spec.check);
    case FramingType::kLengthPrefixed:
      break;
  }
  return link::MakeLengthFraming({spec.sync, NumberBytes(spec.length)}, spec.check);
}

// The longest payload that a frame can hold, and the reason.
std::pair<std::size_t, std::string_view> LongestPayload(const ProtocolSpec& spec) {
  constexpr std::size_t kU8Max = 255;
  if (spec.framing == FramingType::kLengthPrefixed && spec.length == NumberType::kU8)
    return {kU8Max, "more than a length of type u8 can count; write `length: u16`"};
  return {link::kPayloadBytesMax, "more than a payload can hold"};
}

// Turns what a file says into a protocol, and notes what does not fit together.
class Maker {
 public:
  Maker(const ProtocolSpec& spec, const YamlNode& mapping, std::vector<YamlProblem>& problems)
      : spec_(spec), mapping_(mapping), problems_(problems) {}

  std::shared_ptr<const link::Protocol> Make() {
    link::Protocol protocol;
    protocol.name = spec_.name;
    protocol.control_period_ns =
        PeriodOf(spec_.control_period_ms, PlaceOf(mapping_, "control_period_ms"), "control_period_ms");
    protocol.answers_before_start = spec_.answers_before_start;
    protocol.repeated_start_is_boot = spec_.repeated_start == RepeatedStart::kBoot;
    protocol.world = spec_.world;
    protocol.body = spec_.body;
    const YamlNode* list = ValueOf(&mapping_, "messages");
    const bool is_list = list != nullptr && list->kind == YamlNode::Kind::kSequence &&
                         list->items.size() == spec_.messages.size();
    if (!is_list) return nullptr;  // and said so
    nodes_ = list->items;
    if (nodes_.size() > kMessagesMax)
      Complain(list->mark, fmt::format("messages: more than {} messages", kMessagesMax));
    for (std::size_t i = 0; i < nodes_.size(); ++i) protocol.messages.push_back(MessageOf(i));
    CheckNames();
    CheckIds();
    CheckTimes(protocol);
    CheckReplies(protocol);
    CheckStart(protocol);
    for (std::size_t i = 0; i < nodes_.size(); ++i) SetRole(i, protocol.messages[i]);
    CheckRoles(protocol);
    if (!problems_.empty()) return nullptr;
    protocol.framing = FramingOf(spec_);
    return std::make_shared<const link::Protocol>(std::move(protocol));
  }

 private:
  void Complain(YamlMark mark, std::string message) { problems_.push_back({mark, std::move(message)}); }
  YamlMark Place(std::size_t message, std::string_view key = "name") const {
    return PlaceOf(nodes_[message], key);
  }

  TimeNs PeriodOf(double period_ms, YamlMark mark, std::string_view key) {
    const double period_ns = period_ms * static_cast<double>(kNsPerMs);
    if (std::abs(period_ns - std::round(period_ns)) > 1e-6)
      Complain(mark, fmt::format("{}: {} ms is not a whole number of nanoseconds", key, period_ms));
    return static_cast<TimeNs>(std::llround(period_ns));
  }

  MessageType MessageOf(std::size_t i) {
    const MessageSpec& spec = spec_.messages[i];
    MessageType type;
    type.name = spec.name;
    type.direction = spec.line == LineName::kReference  ? Direction::kReference
                     : spec.from == LineEnd::kServerEnd ? Direction::kToClient
                                                        : Direction::kToPlant;
    if (spec.line == LineName::kReference && spec.from == LineEnd::kClientEnd)
      Complain(Place(i, "line"), "line: the client only listens to the reference line: write `from: server`");
    if (spec.id) type.id = IdOf(i, *spec.id);
    type.reply = spec.reply;
    if (spec.period_ms) type.period_ns = PeriodOf(*spec.period_ms, Place(i, "period_ms"), "period_ms");
    const YamlNode* fields = ValueOf(&nodes_[i], "fields");
    for (std::size_t k = 0; k < spec.fields.size(); ++k) {
      type.fields.push_back(FieldOf(spec, spec.fields[k], fields->items[k]));
      for (std::size_t earlier = 0; earlier < k; ++earlier)
        if (!spec.fields[k].signal.empty() && spec.fields[earlier].signal == spec.fields[k].signal)
          Complain(PlaceOf(fields->items[k], "signal"),
                   fmt::format("signal: '{}' is in this message already", spec.fields[k].signal));
    }
    type = LayOut(std::move(type));
    const auto [longest, why] = LongestPayload(spec_);
    if (type.payload_bytes > longest)
      Complain(Place(i), fmt::format("name: the payload of '{}' has {} bytes, {}; the longest has {}",
                                     spec.name, type.payload_bytes, why, longest));
    if (type.payload_bytes == 0)
      Complain(Place(i),
               fmt::format("name: '{}' has neither an id nor fields: its payload would be empty", spec.name));
    return type;
  }

  std::optional<link::MessageId> IdOf(std::size_t i, double value) {
    link::MessageId id = {.type = spec_.id_type, .order = spec_.id_order.value_or(spec_.order)};
    std::array<std::uint8_t, 8> bytes{};
    StoreNumber(id.type, id.order, value, bytes);
    if (LoadNumber(id.type, id.order, bytes) != value) {
      Complain(Place(i, "id"),
               fmt::format("id: {} is not a number of type {}, which ids have here (key 'id' of the file)",
                           value, Name(id.type)));
      return std::nullopt;
    }
    id.bits = static_cast<std::uint32_t>(LoadBits(id.type, id.order, bytes));
    return id;
  }

  MessageField FieldOf(const MessageSpec& message, const FieldSpec& spec, const YamlNode& node) {
    MessageField field{.signal = spec.signal,
                       .type = spec.type,
                       .order = spec.order.value_or(spec_.order),
                       .scale = spec.scale,
                       .content = ContentOf(spec.signal),
                       .as = spec.as};
    if (field.content != FieldContent::kSignal) {
      if (spec.type != NumberType::kU8 && spec.type != NumberType::kU16 && spec.type != NumberType::kU32)
        Complain(PlaceOf(node, "type"),
                 fmt::format("type: '{}' is a count that wraps: it needs u8, u16 or u32", spec.signal));
      const std::pair<const char*, bool> given[] = {{"scale", spec.scale != 1.0},
                                                    {"min", spec.min.has_value()},
                                                    {"max", spec.max.has_value()},
                                                    {"as", spec.as != link::ThrustUnit::kNewton}};
      for (const auto& [key, is_given] : given)
        if (is_given)
          Complain(PlaceOf(node, key),
                   fmt::format("{}: '{}' has no {}: every value may come", key, spec.signal, key));
    }
    if (spec.as != link::ThrustUnit::kNewton && message.from == LineEnd::kServerEnd &&
        message.line == LineName::kReference)
      Complain(PlaceOf(node, "as"), "as: the reference has no thrusts");
    SetRange(spec, node, field);
    return field;
  }

  void SetRange(const FieldSpec& spec, const YamlNode& node, MessageField& field) {
    // An integer may have any value of its type.
    double magnitude = kMagnitudeMax;
    if (!link::IsInteger(field.type))
      magnitude = spec.as == link::ThrustUnit::kNewton
                      ? std::min(kMagnitudeMax, link::PlausibleMagnitude(field.signal))
                      : kShareMagnitude;
    field.min = spec.min.value_or(std::max(field.scale * link::LeastNumber(field.type), -magnitude));
    field.max = spec.max.value_or(std::min(field.scale * link::LargestNumber(field.type), magnitude));
    if (field.min > field.max)
      return Complain(
          PlaceOf(node, spec.min ? "min" : "max"),
          fmt::format("{}: min {} is above max {}", spec.min ? "min" : "max", field.min, field.max));
    const auto check = [&](const char* key, double value) {
      const double number = value / field.scale;
      const bool fits = link::IsInteger(field.type)
                            ? std::round(number) >= link::LeastNumber(field.type) &&
                                  std::round(number) <= link::LargestNumber(field.type)
                            : std::abs(number) <= link::LargestNumber(field.type) * (1 + 1e-12);
      if (!fits)
        Complain(PlaceOf(node, key),
                 fmt::format("{}: {} is {:.10g} on the line (scale {}), and {} holds {} to {}", key, value,
                             std::round(number), field.scale, Name(field.type), link::LeastNumber(field.type),
                             link::LargestNumber(field.type)));
    };
    if (spec.min) check("min", *spec.min);
    if (spec.max) check("max", *spec.max);
    // A sender at the end of the range sends the nearest number that the field can hold, which may lie a little beyond.
    if (spec.min) field.min = std::min(field.min, link::ValueOnLine(field, field.min));
    if (spec.max) field.max = std::max(field.max, link::ValueOnLine(field, field.max));
  }

  void CheckNames() {
    for (std::size_t i = 0; i < nodes_.size(); ++i)
      for (std::size_t earlier = 0; earlier < i; ++earlier)
        if (!spec_.messages[i].name.empty() && spec_.messages[earlier].name == spec_.messages[i].name) {
          Complain(Place(i), fmt::format("name: '{}' is taken already on line {}", spec_.messages[i].name,
                                         Place(earlier).line));
          break;
        }
  }

  static bool SameWire(const MessageSpec& a, const MessageSpec& b) {
    return a.from == b.from && a.line == b.line;
  }

  void CheckIds() {
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      const MessageSpec& own = spec_.messages[i];
      for (std::size_t other = 0; other < nodes_.size(); ++other) {
        if (other == i || !SameWire(own, spec_.messages[other])) continue;
        if (!own.id) {
          Complain(Place(i),
                   fmt::format("name: '{}' needs an id, because '{}' (line {}) travels in the same direction",
                               own.name, spec_.messages[other].name, Place(other).line));
          break;
        }
        if (other < i && own.id == spec_.messages[other].id) {
          Complain(Place(i, "id"), fmt::format("id: {} is that of '{}' on line {} already", *own.id,
                                               spec_.messages[other].name, Place(other, "id").line));
          break;
        }
      }
    }
  }

  // The place of a message of that name; none: it is said.
  std::optional<std::size_t> FindNamed(std::string_view name, LineEnd from, YamlMark mark,
                                       std::string_view key) {
    std::vector<std::string_view> names;
    for (std::size_t i = 0; i < spec_.messages.size(); ++i) {
      const MessageSpec& message = spec_.messages[i];
      if (message.from != from || message.line != LineName::kMain) continue;
      if (message.name == name) return i;
      names.push_back(message.name);
    }
    Complain(mark,
             fmt::format("{}: the {} has no message '{}'{}", key, Name(from), name, DidYouMean(name, names)));
    return std::nullopt;
  }

  // A receiver takes a time that is half the range of its type ahead for an old one.
  void CheckTimes(const link::Protocol& protocol) {
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      const MessageType& type = protocol.messages[i];
      const TimeNs period_ns = type.period_ns > 0 ? type.period_ns : protocol.control_period_ns;
      for (std::size_t k = 0; k < type.fields.size(); ++k) {
        const MessageField& field = type.fields[k];
        const double half_us = (link::LargestNumber(field.type) + 1) / 2;
        if (field.content != FieldContent::kTimeUs || half_us * kNsPerUs > static_cast<double>(period_ns))
          continue;
        Complain(PlaceOf(ValueOf(&nodes_[i], "fields")->items[k], "type"),
                 fmt::format("type: a time of type {} wraps every {} us, which is less than two periods of "
                             "{} us; write u32",
                             Name(field.type), 2 * half_us, period_ns / kNsPerUs));
      }
    }
  }

  void CheckReplies(const link::Protocol& protocol) {
    bool has_request = false, has_period = false;
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      const MessageSpec& message = spec_.messages[i];
      has_period = has_period || message.period_ms;
      if (message.period_ms && message.from == LineEnd::kClientEnd)
        Complain(Place(i, "period_ms"), "period_ms: only the server sends messages by itself here");
      if (message.period_ms && message.line == LineName::kReference)
        Complain(Place(i, "period_ms"), "period_ms: a reference is sent once in each control period");
      if (message.reply.empty()) continue;
      has_request = true;
      const YamlMark place = Place(i, "reply");
      if (message.from == LineEnd::kServerEnd) {
        Complain(place, "reply: only the client's messages are answered");
        continue;
      }
      if (spec_.exchange == ExchangeType::kStream)
        Complain(place, "reply: a stream has no requests: leave it out, or write `exchange: request_reply`");
      const auto reply = FindNamed(message.reply, LineEnd::kServerEnd, place, "reply");
      if (reply && protocol.messages[*reply].period_ns != 0)
        Complain(Place(*reply, "period_ms"),
                 fmt::format("period_ms: '{}' is a reply, which is sent only when it is asked for",
                             message.reply));
    }
    const YamlMark exchange = PlaceOf(mapping_, "exchange");
    if (spec_.exchange == ExchangeType::kRequestReply && !has_request)
      Complain(exchange, "exchange: request_reply needs a message from the client with a 'reply'");
    if (spec_.exchange == ExchangeType::kStream && !has_period)
      Complain(exchange, "exchange: stream needs a message from the server with a 'period_ms'");
  }

  void CheckStart(link::Protocol& protocol) {
    const bool is_first = spec_.start_message.empty();
    const std::string& name = is_first ? spec_.first_message : spec_.start_message;
    if (name.empty()) return;  // and said so
    const std::string_view key = is_first ? "first" : "message";
    const YamlMark mark = PlaceOf(mapping_, fmt::format("start.{}", key));
    if (const auto place = FindNamed(name, LineEnd::kClientEnd, mark, key))
      protocol.messages[*place].starts = true;
    const MessageType* start = protocol.Find(name);
    if (!is_first && start != nullptr && !start->reply.empty())
      Complain(mark, fmt::format("message: '{}' comes again in every period, because it has a 'reply': write "
                                 "`first: {}`",
                                 name, name));
    if (is_first && spec_.repeated_start == RepeatedStart::kBoot)
      Complain(PlaceOf(mapping_, "start.repeated"),
               fmt::format(
                   "repeated: '{}' comes again in every flight: only a `message` of its own can mean a boot",
                   name));
  }

  bool IsReply(const MessageType& type) const {
    return std::any_of(spec_.messages.begin(), spec_.messages.end(),
                       [&](const MessageSpec& message) { return message.reply == type.name; });
  }

  void SetRole(std::size_t i, MessageType& type) {
    const bool has_signals =
        std::any_of(type.fields.begin(), type.fields.end(),
                    [](const MessageField& field) { return field.content == FieldContent::kSignal; });
    switch (type.direction) {
      case Direction::kReference:
        type.kind = MessageKind::kReference;
        return;
      case Direction::kToClient:
        type.kind = IsReply(type) ? MessageKind::kReply : MessageKind::kStreamed;
        if (type.kind == MessageKind::kStreamed && type.period_ns == 0)
          Complain(
              Place(i),
              fmt::format("name: nothing makes the server send '{}': give it a period_ms, or name it as a "
                          "'reply'",
                          type.name));
        return;
      case Direction::kToPlant:
        break;
    }
    if (type.starts && spec_.first_message.empty())
      type.kind = MessageKind::kStart;
    else if (!type.reply.empty())
      type.kind = MessageKind::kRequest;
    else
      type.kind = has_signals ? MessageKind::kActuators : MessageKind::kOther;
  }

  void CheckRoles(const link::Protocol& protocol) {
    const YamlMark messages = PlaceOf(mapping_, "messages");
    if (protocol.Find(MessageKind::kActuators) == nullptr) {
      const MessageType* start = protocol.Find(MessageKind::kStart);
      if (start != nullptr && start->has_signals())
        Complain(PlaceOf(mapping_, "start.message"),
                 fmt::format(
                     "message: '{}' alone carries inputs of the vehicle, and a `message` comes once: write "
                     "`first: {}`",
                     start->name, start->name));
      else
        Complain(messages,
                 "messages: the client has no actuator message: one with the vehicle's inputs as fields");
    }
    const MessageType* reference = protocol.Find(MessageKind::kReference);
    for (std::size_t i = 0; i < nodes_.size(); ++i)
      if (protocol.messages[i].kind == MessageKind::kReference && &protocol.messages[i] != reference)
        Complain(Place(i, "line"),
                 fmt::format("line: '{}' is the message of the reference line already", reference->name));
  }

  const ProtocolSpec& spec_;
  const YamlNode& mapping_;
  std::vector<YamlProblem>& problems_;
  std::span<const YamlNode> nodes_;  // of the messages
};

MessageSpec SpecOf(const MessageType& type) {
  MessageSpec spec;
  spec.name = type.name;
  spec.from = type.direction == Direction::kToPlant ? LineEnd::kClientEnd : LineEnd::kServerEnd;
  spec.line = type.direction == Direction::kReference ? LineName::kReference : LineName::kMain;
  spec.reply = type.reply;
  if (type.period_ns != 0)
    spec.period_ms = static_cast<double>(type.period_ns) / static_cast<double>(kNsPerMs);
  if (type.id) {
    std::array<std::uint8_t, 8> bytes{};
    StoreBits(type.id->type, type.id->order, type.id->bits, bytes);
    spec.id = LoadNumber(type.id->type, type.id->order, bytes);
  }
  for (const MessageField& field : type.fields) {
    FieldSpec& own = spec.fields.emplace_back();
    own.signal = field.signal;
    own.type = field.type;
    own.order = field.order;
    if (field.content != FieldContent::kSignal) continue;
    own.scale = field.scale;
    own.min = field.min;
    own.max = field.max;
    own.as = field.as;
  }
  return spec;
}

}  // namespace

std::string_view Name(FramingType type) {
  static constexpr std::array<std::string_view, 3> kNames = {"hdlc", "cobs", "length_prefixed"};
  return kNames[static_cast<std::size_t>(type)];
}
std::string_view Name(ExchangeType type) {
  return type == ExchangeType::kRequestReply ? "request_reply" : "stream";
}
std::string_view Name(RepeatedStart repeated) {
  return repeated == RepeatedStart::kIgnored ? "ignored" : "boot";
}
std::string_view Name(LineEnd end) { return end == LineEnd::kClientEnd ? "client" : "server"; }
std::string_view Name(LineName line) { return line == LineName::kMain ? "main" : "reference"; }

ProtocolSpec SpecOf(const link::Protocol& protocol) {
  constexpr double kNsInMs = static_cast<double>(kNsPerMs);
  ProtocolSpec spec;
  spec.name = protocol.name;
  spec.control_period_ms = static_cast<double>(protocol.control_period_ns) / kNsInMs;
  const link::Framing& framing = *protocol.framing;
  for (const FramingType type : {FramingType::kHdlc, FramingType::kCobs, FramingType::kLengthPrefixed})
    if (Name(type) == framing.name()) spec.framing = type;
  spec.check = framing.check().value_or(link::CheckKind::kNone);
  if (spec.framing == FramingType::kLengthPrefixed) {
    const auto sync = framing.special_bytes();
    spec.sync.assign(sync.begin(), sync.end());
    // An empty payload has nothing else in its frame.
    const std::size_t length_bytes = framing.Encode({}).size() - sync.size() - framing.check_bytes();
    spec.length = length_bytes == 1 ? NumberType::kU8 : NumberType::kU16;
  }
  spec.answers_before_start = protocol.answers_before_start;
  spec.repeated_start = protocol.repeated_start_is_boot ? RepeatedStart::kBoot : RepeatedStart::kIgnored;
  spec.world = protocol.world;
  spec.body = protocol.body;
  spec.exchange = ExchangeType::kStream;
  for (const MessageType& type : protocol.messages) {
    if (!type.reply.empty()) spec.exchange = ExchangeType::kRequestReply;
    if (type.starts) (type.kind == MessageKind::kStart ? spec.start_message : spec.first_message) = type.name;
    if (type.id) {
      spec.id_type = type.id->type;
      spec.id_order = type.id->order;
    }
    spec.messages.push_back(SpecOf(type));
  }
  return spec;
}

std::shared_ptr<const link::Protocol> MakeProtocol(const ProtocolSpec& spec, const YamlNode& mapping,
                                                   std::vector<YamlProblem>& problems) {
  return Maker(spec, mapping, problems).Make();
}

ProtocolFile ParseProtocolFile(const std::string& text, const std::filesystem::path& file) {
  std::vector<YamlProblem> problems;
  ProtocolFile read{.protocol = nullptr, .root = ParseMapping(text, file, problems)};
  ProtocolSpec spec;
  MappingReader reader(read.root, problems);
  DescribeProtocol(reader, spec);
  reader.Finish();
  if (problems.empty()) read.protocol = MakeProtocol(spec, read.root, problems);
  if (!problems.empty()) ThrowProblems(file, std::move(problems));
  return read;
}

std::string DialectOf(const link::Protocol& protocol) {
  for (const auto& shipped : ShippedProtocols())
    if (SameOnTheLine(protocol, *shipped)) return shipped->name;
  return protocol.name;
}

std::string TakenProtocolName(std::string_view name) {
  const auto shipped = ShippedProtocolNames();
  if (std::find(shipped.begin(), shipped.end(), name) == shipped.end()) return {};
  return fmt::format("protocol: '{}' is the name of a protocol that tiltproof ships; choose another", name);
}

std::optional<YamlMark> PlaceOfField(const YamlNode& protocol, std::string_view message,
                                     std::string_view signal) {
  const auto find = [](const YamlNode* list, std::string_view key, std::string_view text) -> const YamlNode* {
    if (list == nullptr) return nullptr;
    for (const YamlNode& item : list->items)
      if (const YamlNode* value = ValueOf(&item, key); value != nullptr && value->text == text) return &item;
    return nullptr;
  };
  const YamlNode* found = find(ValueOf(&protocol, "messages"), "name", message);
  const YamlNode* field = find(ValueOf(found, "fields"), "signal", signal);
  return field == nullptr ? std::nullopt : std::optional(PlaceOf(*field, "signal"));
}

ProtocolFile LoadProtocolFile(const std::filesystem::path& file) {
  ProtocolFile read = ParseProtocolFile(ReadYamlText(file), file);
  if (std::string taken = TakenProtocolName(read.protocol->name); !taken.empty())
    ThrowProblems(file, {{PlaceOf(read.root, "protocol"), std::move(taken)}});
  return read;
}

std::shared_ptr<const link::Protocol> ReadProtocolFile(const std::filesystem::path& file) {
  return LoadProtocolFile(file).protocol;
}

}  // namespace tiltproof::harness
