#include "link/protocol.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>

#include "link/check.h"

namespace tiltproof::link {
namespace {

// Sets `found` when it returns kOk.
MessageStatus FindType(const Protocol& protocol, Direction direction, std::span<const std::uint8_t> payload,
                       const MessageType*& found) {
  for (const MessageType& type : protocol.messages) {
    if (type.direction != direction) continue;
    if (type.id) {
      if (payload.size() < NumberBytes(type.id->type)) return MessageStatus::kBadLength;
      if (LoadBits(type.id->type, type.id->order, payload) != type.id->bits) continue;
    }
    if (payload.size() != type.payload_bytes) return MessageStatus::kBadLength;
    found = &type;
    return MessageStatus::kOk;
  }
  return MessageStatus::kUnknownId;
}

// Fields of that type's signals; sequence and time stay.
MessageType WithSignals(MessageType type, const std::vector<std::string>& signals) {
  std::erase_if(type.fields,
                [](const MessageField& field) { return field.content == FieldContent::kSignal; });
  for (const std::string& signal : signals) {
    const double magnitude = std::min(PlausibleMagnitude(signal), LargestNumber(NumberType::kF32));
    type.fields.push_back({signal, -magnitude, magnitude});
  }
  return LayOut(std::move(type));
}

std::vector<std::string> SignalsOf(const MessageType& type) {
  std::vector<std::string> signals;
  for (const MessageField& field : type.fields)
    if (field.content == FieldContent::kSignal) signals.push_back(field.signal);
  return signals;
}

// The number checks that its end is inside, too.
double ValueOf(const MessageField& field, std::span<const std::uint8_t> payload) {
  CheckPart(field.offset, 0, payload.size(), "a field is inside its payload");
  return field.scale * LoadNumber(field.type, field.order, payload.subspan(field.offset));
}

void SetValue(const MessageField& field, std::span<std::uint8_t> payload, double value) {
  CheckPart(field.offset, 0, payload.size(), "a field is inside its payload");
  StoreNumber(field.type, field.order, field.scale == 1.0 ? value : value / field.scale,
              payload.subspan(field.offset));
}

}  // namespace

bool MessageType::has_signals() const {
  return std::any_of(fields.begin(), fields.end(),
                     [](const MessageField& field) { return field.content == FieldContent::kSignal; });
}

const MessageType* Protocol::Find(std::string_view message) const {
  const auto found = std::find_if(messages.begin(), messages.end(),
                                  [&](const MessageType& type) { return type.name == message; });
  if (found != messages.end()) return &*found;
  if (message == "sensors") return Find(MessageKind::kReply);
  return message == "read_sensors" ? Find(MessageKind::kRequest) : nullptr;
}

const MessageType* Protocol::Find(MessageKind kind) const {
  const auto found = std::find_if(messages.begin(), messages.end(),
                                  [&](const MessageType& type) { return type.kind == kind; });
  return found == messages.end() ? nullptr : &*found;
}

const MessageType& Protocol::PeriodMessage() const {
  const bool streams = std::any_of(messages.begin(), messages.end(), [this](const MessageType& type) {
    return type.period_ns > 0 && type.period_ns <= control_period_ns;
  });
  const auto request = std::find_if(messages.begin(), messages.end(), [](const MessageType& type) {
    return type.direction == Direction::kToPlant && !type.reply.empty();
  });
  if (!streams && request != messages.end()) return *request;
  const MessageType* actuators = Find(MessageKind::kActuators);
  Check(actuators != nullptr, "a client asks or commands once a period");
  return *actuators;
}

const MessageType* Protocol::Classify(Direction direction, std::span<const std::uint8_t> payload) const {
  const MessageType* type = nullptr;
  return FindType(*this, direction, payload, type) == MessageStatus::kOk ? type : nullptr;
}

MessageStatus Protocol::Decode(Direction direction, std::span<const std::uint8_t> payload,
                               Message& message) const {
  const MessageType* type = nullptr;
  if (const MessageStatus status = FindType(*this, direction, payload, type); status != MessageStatus::kOk)
    return status;
  std::array<double, kPayloadBytesMax> values;
  Check(type->fields.size() <= values.size(), "a payload has room for all fields of its message");
  bool in_range = true;
  for (std::size_t i = 0; i < type->fields.size(); ++i) {
    const MessageField& field = type->fields[i];
    values[i] = ValueOf(field, payload);
    if (!std::isfinite(values[i])) return MessageStatus::kNotFinite;
    in_range = in_range && field.min <= values[i] && values[i] <= field.max;
  }
  if (!in_range) return MessageStatus::kOutOfRange;
  message.type = type;
  message.values.assign(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(type->fields.size()));
  return MessageStatus::kOk;
}

Payload Protocol::Encode(const MessageType& type, std::span<const double> values) const {
  Check(values.size() == type.fields.size(), "a message is encoded with a value for each of its fields");
  Check(type.payload_bytes <= kPayloadBytesMax, "a message fits into a payload");
  Payload payload;
  payload.size = type.payload_bytes;
  const std::span<std::uint8_t> bytes(payload.bytes.data(), payload.size);
  if (type.id) StoreBits(type.id->type, type.id->order, type.id->bits, bytes);
  for (std::size_t i = 0; i < values.size(); ++i) SetValue(type.fields[i], bytes, values[i]);
  return payload;
}

void SetFieldValue(const MessageType& type, std::span<std::uint8_t> payload, std::size_t field,
                   double value) {
  CheckIndex(field, type.fields.size(), "a field is one of its message");
  SetValue(type.fields[field], payload, value);
}

double FieldValue(const MessageType& type, std::span<const std::uint8_t> payload, std::size_t field) {
  CheckIndex(field, type.fields.size(), "a field is one of its message");
  return ValueOf(type.fields[field], payload);
}

double ValueOnLine(const MessageField& field, double value) {
  std::array<std::uint8_t, 8> bytes{};
  StoreNumber(field.type, field.order, value / field.scale, bytes);
  return field.scale * LoadNumber(field.type, field.order, bytes);
}

double PlausibleMagnitude(std::string_view signal) {
  struct Limit {
    std::string_view suffix;
    double magnitude;
  };
  // The longer one of two endings that fit comes first.
  static constexpr std::array<Limit, 9> kLimits = {{{"_m_s2", 1e4},
                                                    {"_pa", 1e7},
                                                    {"_deg", 360.0},
                                                    {"_rad_s", 1e3},
                                                    {"_rad", 100.0},  // unwrapped yaw included
                                                    {"_m_s", 1e3},
                                                    {"_nm", 1e2},
                                                    {"_m", 1e4},
                                                    {"_n", 1e3}}};
  for (const Limit& limit : kLimits)
    if (signal.ends_with(limit.suffix)) return limit.magnitude;
  return std::numeric_limits<double>::infinity();
}

std::string_view Name(ThrustUnit unit) {
  static constexpr std::array<std::string_view, 3> kNames = {"newton", "share", "share_of_speed"};
  return kNames[static_cast<std::size_t>(unit)];
}
std::string_view Name(WorldAxes axes) { return axes == WorldAxes::kEnu ? "enu" : "ned"; }
std::string_view Name(BodyAxes axes) { return axes == BodyAxes::kFlu ? "flu" : "frd"; }

MessageId FloatId(float value) { return {.bits = std::bit_cast<std::uint32_t>(value)}; }

MessageType LayOut(MessageType type) {
  std::size_t offset = type.id ? NumberBytes(type.id->type) : 0;
  for (MessageField& field : type.fields) {
    field.offset = offset;
    offset += NumberBytes(field.type);
  }
  type.payload_bytes = offset;
  return type;
}

bool SameOnTheLine(const Protocol& a, const Protocol& b) {
  const auto same_field = [](const MessageField& x, const MessageField& y) {
    return x.signal == y.signal && x.type == y.type && x.order == y.order && x.scale == y.scale &&
           x.as == y.as;
  };
  const auto same_id = [](const std::optional<MessageId>& x, const std::optional<MessageId>& y) {
    return x.has_value() == y.has_value() &&
           (!x || (x->type == y->type && x->order == y->order && x->bits == y->bits));
  };
  const auto same_message = [&](const MessageType& x, const MessageType& y) {
    return x.kind == y.kind && x.direction == y.direction && x.starts == y.starts &&
           x.period_ns == y.period_ns && same_id(x.id, y.id) &&
           std::ranges::equal(x.fields, y.fields, same_field);
  };
  // A frame has the whole framing: its ends, and the check.
  constexpr std::array<std::uint8_t, 4> kSample = {0x00, 0x7D, 0x7E, 0xFF};
  return a.framing->name() == b.framing->name() && a.framing->Encode(kSample) == b.framing->Encode(kSample) &&
         a.control_period_ns == b.control_period_ns && a.answers_before_start == b.answers_before_start &&
         a.repeated_start_is_boot == b.repeated_start_is_boot && a.world == b.world && a.body == b.body &&
         std::ranges::equal(a.messages, b.messages, same_message);
}

std::shared_ptr<const Protocol> ForVehicle(std::shared_ptr<const Protocol> protocol,
                                           const VehicleSignals& vehicle) {
  if (!protocol->any_vehicle) return protocol;
  std::vector<std::string> sensors, inputs;
  for (const Signal& sensor : vehicle.sensors)
    if (vehicle.states.Find(sensor.name)) sensors.push_back(sensor.name);
  for (const Signal& input : vehicle.inputs) inputs.push_back(input.name);
  Protocol changed = *protocol;
  bool changes = false;
  for (MessageType& type : changed.messages) {
    if (type.kind != MessageKind::kReply && type.kind != MessageKind::kActuators) continue;
    const std::vector<std::string>& signals = type.kind == MessageKind::kReply ? sensors : inputs;
    if (SignalsOf(type) == signals) continue;
    type = WithSignals(std::move(type), signals);
    changes = true;
  }
  return changes ? std::make_shared<const Protocol>(std::move(changed)) : protocol;
}

}  // namespace tiltproof::link
