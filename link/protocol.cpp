#include "link/protocol.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "link/check.h"

namespace tiltproof::link {
namespace {

constexpr std::size_t kIdBytes = 4;

std::uint32_t LoadBits(std::span<const std::uint8_t> bytes) {
  CheckPart(0, 4, bytes.size(), "a number of a message has four bytes");
  std::uint32_t bits = 0;
  for (std::size_t i = 4; i-- > 0;) bits = bits << 8 | bytes[i];
  return bits;
}

void Append(Payload& payload, float value) {
  const auto bits = std::bit_cast<std::uint32_t>(value);
  CheckPart(payload.size, 4, payload.bytes.size(), "a message fits into a payload");
  for (unsigned shift = 0; shift < 32; shift += 8)
    payload.bytes[payload.size++] = static_cast<std::uint8_t>(bits >> shift & 0xFF);
}

// Sets `found` when it returns kOk.
MessageStatus FindType(const Protocol& protocol, Direction direction, std::span<const std::uint8_t> payload,
                       const MessageType*& found) {
  for (const MessageType& type : protocol.messages) {
    if (type.direction != direction) continue;
    if (type.id) {
      if (payload.size() < kIdBytes) return MessageStatus::kBadLength;
      if (std::bit_cast<std::uint32_t>(*type.id) != LoadBits(payload)) continue;
    }
    if (payload.size() != type.payload_bytes()) return MessageStatus::kBadLength;
    found = &type;
    return MessageStatus::kOk;
  }
  return MessageStatus::kUnknownId;
}

// --- The protocols that are built in.

// Beyond this magnitude a value is not a state of a small aircraft but a damaged message. A signal's name ends in
// its unit; of two endings that fit, the longer comes first.
float PlausibleMagnitude(std::string_view signal) {
  struct Limit {
    std::string_view suffix;
    float magnitude;
  };
  static constexpr std::array<Limit, 6> kLimits = {{{"_rad_s", 1e3F},
                                                    {"_rad", 100.F},  // unwrapped yaw included
                                                    {"_m_s", 1e3F},
                                                    {"_nm", 1e2F},
                                                    {"_m", 1e4F},
                                                    {"_n", 1e3F}}};
  for (const Limit& limit : kLimits)
    if (signal.ends_with(limit.suffix)) return limit.magnitude;
  ThrowBrokenInvariant("a signal of a built-in protocol with a unit");
}

std::vector<MessageField> Fields(const std::vector<std::string>& signals) {
  std::vector<MessageField> fields;
  for (const std::string& signal : signals) {
    const float magnitude = PlausibleMagnitude(signal);
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
  return {.name = name,
          .control_period_ns = 12 * kNsPerMs,
          .messages = {{.name = "start",
                        .kind = MessageKind::kStart,
                        .direction = Direction::kToPlant,
                        .id = start_id,
                        .starts = true,
                        .fields = start_has_inputs ? inputs : std::vector<MessageField>()},
                       {.name = "read_sensors",
                        .kind = MessageKind::kRequest,
                        .direction = Direction::kToPlant,
                        .id = read_id,
                        .reply = "sensors"},
                       {.name = "actuators",
                        .kind = MessageKind::kActuators,
                        .direction = Direction::kToPlant,
                        .id = actuators_id,
                        .fields = inputs},
                       {.name = "sensors",
                        .kind = MessageKind::kReply,
                        .direction = Direction::kToClient,
                        .fields = sensors},
                       {.name = "reference",
                        .kind = MessageKind::kReference,
                        .direction = Direction::kReference,
                        .fields = reference}}};
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

const MessageType* Protocol::Classify(Direction direction, std::span<const std::uint8_t> payload) const {
  const MessageType* type = nullptr;
  return FindType(*this, direction, payload, type) == MessageStatus::kOk ? type : nullptr;
}

MessageStatus Protocol::Decode(Direction direction, std::span<const std::uint8_t> payload,
                               Message& message) const {
  const MessageType* type = nullptr;
  if (const MessageStatus status = FindType(*this, direction, payload, type); status != MessageStatus::kOk)
    return status;
  std::array<float, kPayloadBytesMax / 4> values;
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

Payload Protocol::Encode(const MessageType& type, std::span<const float> values) const {
  Check(values.size() == type.fields.size(), "a message is encoded with a value for each of its fields");
  Payload payload;
  if (type.id) Append(payload, *type.id);
  for (const float value : values) Append(payload, value);
  return payload;
}

float FieldValue(const MessageType& type, std::span<const std::uint8_t> payload, std::size_t field) {
  const std::size_t offset = (type.id ? kIdBytes : 0) + 4 * field;
  CheckPart(offset, 4, payload.size(), "a field is inside its payload");
  return std::bit_cast<float>(LoadBits(payload.subspan(offset)));
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
