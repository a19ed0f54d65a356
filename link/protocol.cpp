#include "link/protocol.h"

#include <algorithm>
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

// --- The protocols that are built in.

std::vector<MessageField> Fields(const std::vector<std::string>& signals) {
  std::vector<MessageField> fields;
  for (const std::string& signal : signals) {
    const double magnitude = PlausibleMagnitude(signal);
    fields.push_back({signal, -magnitude, magnitude});
  }
  return fields;
}

// The ids of a client's messages, and the content of `start`.
struct Services {
  std::string name;
  float start_id;
  bool start_has_inputs;
  float read_id, actuators_id;
};

// The signals that a protocol carries, by name.
struct Carried {
  std::vector<std::string> sensors, inputs;
  friend bool operator==(const Carried&, const Carried&) = default;
};

const Carried& OfTiltRotor() {
  static const Carried kCarried = {
      .sensors = {"x_m", "y_m", "z_m", "roll_rad", "pitch_rad", "yaw_rad", "alpha_r_rad", "alpha_l_rad",
                  "vx_m_s", "vy_m_s", "vz_m_s", "wx_rad_s", "wy_rad_s", "wz_rad_s", "alpha_r_rad_s",
                  "alpha_l_rad_s"},
      .inputs = {"f_r_n", "f_l_n", "tau_r_nm", "tau_l_nm"}};
  return kCarried;
}

// The common part of both protocols: their client leads, and their server answers with the sensors.
Protocol ProtocolOf(const Services& services, const Carried& carried) {
  const auto& [name, start_id, start_has_inputs, read_id, actuators_id] = services;
  const auto inputs = Fields(carried.inputs), sensors = Fields(carried.sensors);
  const auto reference = Fields({"x_m", "y_m", "z_m", "yaw_rad", "vx_m_s", "vy_m_s", "vz_m_s"});
  Protocol protocol = {.name = name,
                       .control_period_ns = 12 * kNsPerMs,
                       .messages = {{.name = "start",
                                     .kind = MessageKind::kStart,
                                     .direction = Direction::kToPlant,
                                     .id = FloatId(start_id),
                                     .starts = true,
                                     .fields = start_has_inputs ? inputs : std::vector<MessageField>()},
                                    {.name = "read_sensors",
                                     .kind = MessageKind::kRequest,
                                     .direction = Direction::kToPlant,
                                     .id = FloatId(read_id),
                                     .reply = "sensors"},
                                    {.name = "actuators",
                                     .kind = MessageKind::kActuators,
                                     .direction = Direction::kToPlant,
                                     .id = FloatId(actuators_id),
                                     .fields = inputs},
                                    {.name = "sensors",
                                     .kind = MessageKind::kReply,
                                     .direction = Direction::kToClient,
                                     .fields = sensors},
                                    {.name = "reference",
                                     .kind = MessageKind::kReference,
                                     .direction = Direction::kReference,
                                     .fields = reference}}};
  for (MessageType& type : protocol.messages) type = LayOut(std::move(type));
  return protocol;
}

Protocol Paper(const Carried& carried) {
  Protocol protocol = ProtocolOf({"paper", 1.F, false, 2.F, 3.F}, carried);
  protocol.repeated_start_is_boot = true;
  return protocol;
}

// Its `start` is an actuator message that also says "un-pause", each time that it comes.
Protocol Provant() {
  Protocol protocol = ProtocolOf({"provant", 3.F, true, 1.F, 0.F}, OfTiltRotor());
  protocol.answers_before_start = true;
  return protocol;
}

}  // namespace

bool MessageType::has_signals() const {
  return std::any_of(fields.begin(), fields.end(),
                     [](const MessageField& field) { return field.content == FieldContent::kSignal; });
}

const MessageType* Protocol::Find(std::string_view message) const {
  const auto found = std::find_if(messages.begin(), messages.end(),
                                  [&](const MessageType& type) { return type.name == message; });
  return found == messages.end() ? nullptr : &*found;
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
    values[i] = FieldValue(*type, payload, i);
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
  for (std::size_t i = 0; i < values.size(); ++i) SetFieldValue(type, bytes, i, values[i]);
  return payload;
}

void SetFieldValue(const MessageType& type, std::span<std::uint8_t> payload, std::size_t field,
                   double value) {
  CheckIndex(field, type.fields.size(), "a field is one of its message");
  const MessageField& own = type.fields[field];
  CheckPart(own.offset, NumberBytes(own.type), payload.size(), "a field is inside its payload");
  StoreNumber(own.type, own.order, own.scale == 1.0 ? value : value / own.scale, payload.subspan(own.offset));
}

double FieldValue(const MessageType& type, std::span<const std::uint8_t> payload, std::size_t field) {
  CheckIndex(field, type.fields.size(), "a field is one of its message");
  const MessageField& own = type.fields[field];
  CheckPart(own.offset, NumberBytes(own.type), payload.size(), "a field is inside its payload");
  return own.scale * LoadNumber(own.type, own.order, payload.subspan(own.offset));
}

double PlausibleMagnitude(std::string_view signal) {
  struct Limit {
    std::string_view suffix;
    double magnitude;
  };
  // Of two endings that fit, the longer one comes first.
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

std::span<const std::shared_ptr<const Protocol>> Protocols() {
  static const std::array<std::shared_ptr<const Protocol>, 2> kProtocols = {
      std::make_shared<const Protocol>(Paper(OfTiltRotor())), std::make_shared<const Protocol>(Provant())};
  return kProtocols;
}

std::shared_ptr<const Protocol> FindProtocol(std::string_view name) {
  for (const auto& protocol : Protocols())
    if (protocol->name == name) return protocol;
  return nullptr;
}

std::shared_ptr<const Protocol> ForVehicle(std::shared_ptr<const Protocol> protocol,
                                           const VehicleSignals& vehicle) {
  const std::shared_ptr<const Protocol> paper = FindProtocol("paper");
  if (protocol->name != paper->name) return protocol;
  Carried carried;
  for (const Signal& sensor : vehicle.sensors)
    if (vehicle.states.Find(sensor.name)) carried.sensors.push_back(sensor.name);
  for (const Signal& input : vehicle.inputs) carried.inputs.push_back(input.name);
  if (carried == OfTiltRotor()) return paper;
  return std::make_shared<const Protocol>(Paper(carried));
}

}  // namespace tiltproof::link
