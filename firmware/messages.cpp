#include "firmware/messages.h"

#include <bit>
#include <limits>

namespace tiltproof::link {
namespace {

// "..."sv knows its length; a plain literal needs strlen() where nothing is optimised.
using namespace std::string_view_literals;

static_assert(std::numeric_limits<float>::is_iec559 && sizeof(float) == 4);

// --- Floats on the wire: independent of the host's byte order, and of its floating point: limits are
// compared as bit patterns.

constexpr std::uint32_t Bits(float value) { return std::bit_cast<std::uint32_t>(value); }

std::uint32_t LoadBits(const std::uint8_t* bytes) {
  return static_cast<std::uint32_t>(bytes[0]) | static_cast<std::uint32_t>(bytes[1]) << 8 |
         static_cast<std::uint32_t>(bytes[2]) << 16 | static_cast<std::uint32_t>(bytes[3]) << 24;
}

// Without its sign, a binary32's bit pattern grows with its magnitude; infinity and NaN come last.
constexpr std::uint32_t MagnitudeBits(std::uint32_t bits) { return bits & 0x7FFF'FFFF; }
constexpr std::uint32_t kInfinityBits = 0x7F80'0000;

void Append(MessageBytes& message, float value) {
  const std::uint32_t bits = Bits(value);
  for (unsigned shift = 0; shift < 32; shift += 8) {
    message.bytes[message.size++] = static_cast<std::uint8_t>(bits >> shift & 0xFF);
  }
}

// The header of a message of `hardened`: id, number, time. The last two are 0.
void AppendHardenedHeader(MessageBytes& message, std::uint8_t id) {
  message.bytes[message.size] = id;
  message.size += kHardenedHeaderBytes;
}

// The payload must not be shorter than that header.
Stamp LoadStamp(std::span<const std::uint8_t> payload) {
  return {.sequence = static_cast<std::uint16_t>(payload[1] | payload[2] << 8),
          .time_us = LoadBits(payload.data() + 3)};
}

// --- Groups of fields, in wire order.

// A signal's plausible magnitude follows from its unit.
constexpr float Limit(std::string_view column) {
  if (column.ends_with("_rad_s")) return kAngularRateMax_rad_s;
  if (column.ends_with("_rad")) return kAngleMax_rad;
  if (column.ends_with("_m_s")) return kVelocityMax_m_s;
  if (column.ends_with("_m")) return kPositionMax_m;
  if (column.ends_with("_nm")) return kTorqueMax_nm;
  if (column.ends_with("_n")) return kForceMax_n;
  return std::numeric_limits<float>::quiet_NaN();
}

template <template <class> class Group, std::size_t n>
constexpr std::array<std::uint32_t, n> LimitBits(const std::array<SignalField<Group>, n>& fields) {
  std::array<std::uint32_t, n> limits{};
  for (std::size_t i = 0; i < n; ++i) limits[i] = Bits(Limit(fields[i].column));
  return limits;
}
constexpr auto kSensorLimitBits = LimitBits(kSensorFields);
constexpr auto kActuatorLimitBits = LimitBits(kActuatorFields);
constexpr auto kReferenceLimitBits = LimitBits(kReferenceFields);

template <std::size_t n>
constexpr bool AllFinite(const std::array<std::uint32_t, n>& limits) {
  for (const std::uint32_t limit : limits) {
    if (limit >= kInfinityBits) return false;
  }
  return true;
}
static_assert(AllFinite(kSensorLimitBits) && AllFinite(kActuatorLimitBits) && AllFinite(kReferenceLimitBits),
              "every unit on the wire has a limit");

template <template <class> class Group, std::size_t n>
void AppendFields(MessageBytes& message, const Group<float>& group,
                  const std::array<SignalField<Group>, n>& fields) {
  for (const auto& field : fields) Append(message, group.*field.in_float);
}

// `bytes` are n floats.
template <template <class> class Group, std::size_t n>
void LoadFields(const std::uint8_t* bytes, const std::array<SignalField<Group>, n>& fields,
                Group<float>& group) {
  for (const auto& field : fields) {
    group.*field.in_float = std::bit_cast<float>(LoadBits(bytes));
    bytes += 4;
  }
}

template <std::size_t n>
MessageStatus CheckValues(const std::uint8_t* bytes, const std::array<std::uint32_t, n>& limits) {
  bool in_range = true;
  for (const std::uint32_t limit : limits) {
    const std::uint32_t magnitude = MagnitudeBits(LoadBits(bytes));
    if (magnitude >= kInfinityBits) return MessageStatus::kNotFinite;
    in_range = in_range && magnitude <= limit;
    bytes += 4;
  }
  return in_range ? MessageStatus::kOk : MessageStatus::kOutOfRange;
}

// --- What a client can ask.

struct Service {
  Dialect dialect;
  float id;
  MessageKind kind;
  bool has_actuators;

  constexpr std::size_t IdBytes() const { return dialect == Dialect::kHardened ? 1 : kIdBytes; }
  constexpr std::size_t HeaderBytes() const {
    return dialect == Dialect::kHardened ? kHardenedHeaderBytes : kIdBytes;
  }
  constexpr std::size_t Bytes() const { return HeaderBytes() + (has_actuators ? 4 * kActuatorCount : 0); }
  constexpr std::uint8_t Byte() const { return static_cast<std::uint8_t>(id); }
  bool HasId(const std::uint8_t* payload) const {
    return dialect == Dialect::kHardened ? payload[0] == Byte() : LoadBits(payload) == Bits(id);
  }
};
constexpr std::uint8_t kHardenedSensorsId = 4, kHardenedReferenceId = 5;

constexpr std::array<Service, 9> kServices = {{
    {Dialect::kPaper, 1.0F, MessageKind::kStart, false},
    {Dialect::kPaper, 2.0F, MessageKind::kRequest, false},
    {Dialect::kPaper, 3.0F, MessageKind::kActuators, true},
    {Dialect::kProvant, 3.0F, MessageKind::kStart, true},
    {Dialect::kProvant, 1.0F, MessageKind::kRequest, false},
    {Dialect::kProvant, 0.0F, MessageKind::kActuators, true},
    {Dialect::kHardened, 1.0F, MessageKind::kStart, false},
    {Dialect::kHardened, 2.0F, MessageKind::kRequest, false},
    {Dialect::kHardened, 3.0F, MessageKind::kActuators, true},
}};

MessageBytes EncodeRequest(Dialect dialect, MessageKind kind, const Actuators& actuators) {
  MessageBytes message;
  for (const Service& service : kServices) {
    if (service.dialect != dialect || service.kind != kind) continue;
    if (dialect == Dialect::kHardened) {
      AppendHardenedHeader(message, service.Byte());
    } else {
      Append(message, service.id);
    }
    if (service.has_actuators) AppendFields(message, actuators, kActuatorFields);
  }
  return message;
}

// Sets `found` when it returns kOk.
MessageStatus FindService(Dialect dialect, std::span<const std::uint8_t> payload, const Service*& found) {
  for (const Service& service : kServices) {
    if (service.dialect != dialect) continue;
    if (payload.size() < service.IdBytes()) return MessageStatus::kBadLength;
    if (!service.HasId(payload.data())) continue;
    if (payload.size() != service.Bytes()) return MessageStatus::kBadLength;
    found = &service;
    return MessageStatus::kOk;
  }
  return MessageStatus::kUnknownId;
}

}  // namespace

std::string_view Name(Dialect dialect) {
  switch (dialect) {
    case Dialect::kPaper:
      return "paper"sv;
    case Dialect::kProvant:
      return "provant"sv;
    case Dialect::kHardened:
      return "hardened"sv;
  }
  return "unknown"sv;
}

MessageBytes EncodeStart(Dialect dialect, const Actuators& hover) {
  return EncodeRequest(dialect, MessageKind::kStart, hover);
}

MessageBytes EncodeReadSensors(Dialect dialect) { return EncodeRequest(dialect, MessageKind::kRequest, {}); }

MessageBytes EncodeActuators(Dialect dialect, const Actuators& actuators) {
  return EncodeRequest(dialect, MessageKind::kActuators, actuators);
}

MessageBytes EncodeSensors(const Sensors& sensors, Dialect dialect) {
  MessageBytes message;
  if (dialect == Dialect::kHardened) AppendHardenedHeader(message, kHardenedSensorsId);
  AppendFields(message, sensors, kSensorFields);
  return message;
}

MessageBytes EncodeReference(const Reference& reference, Dialect dialect) {
  MessageBytes message;
  if (dialect == Dialect::kHardened) AppendHardenedHeader(message, kHardenedReferenceId);
  AppendFields(message, reference, kReferenceFields);
  return message;
}

void SetStamp(Dialect dialect, Stamp stamp, MessageBytes& message) {
  if (dialect != Dialect::kHardened) return;
  message.bytes[1] = static_cast<std::uint8_t>(stamp.sequence & 0xFF);
  message.bytes[2] = static_cast<std::uint8_t>(stamp.sequence >> 8);
  for (std::size_t i = 0; i < 4; ++i)
    message.bytes[3 + i] = static_cast<std::uint8_t>(stamp.time_us >> 8 * i & 0xFF);
}

std::optional<std::span<const std::uint8_t>> HeaderFilter::Values(std::span<const std::uint8_t> payload) {
  if (dialect_ != Dialect::kHardened) return payload;
  const std::uint8_t id = kind_ == MessageKind::kReference ? kHardenedReferenceId : kHardenedSensorsId;
  if (payload.size() < kHardenedHeaderBytes || payload[0] != id) return std::nullopt;
  const Stamp stamp = LoadStamp(payload);
  if (!IsNewer(stamp)) return std::nullopt;
  seen_ = stamp;
  return payload.subspan(kHardenedHeaderBytes);
}

bool HeaderFilter::IsNewer(Stamp stamp) const {
  if (!accepted_) return true;
  const auto ahead = static_cast<std::uint16_t>(stamp.sequence - accepted_->sequence);
  const std::uint32_t later_us = stamp.time_us - accepted_->time_us;
  return ahead != 0 && ahead < 0x8000 && later_us < 0x8000'0000;
}

MessageStatus DecodeClientMessage(Dialect dialect, std::span<const std::uint8_t> payload,
                                  ClientMessage& message) {
  const Service* service = nullptr;
  MessageStatus status = FindService(dialect, payload, service);
  if (status != MessageStatus::kOk) return status;
  ClientMessage decoded;
  if (service->has_actuators) {
    const std::uint8_t* const values = payload.data() + service->HeaderBytes();
    status = CheckValues(values, kActuatorLimitBits);
    if (status != MessageStatus::kOk) return status;
    LoadFields(values, kActuatorFields, decoded.actuators);
  }
  decoded.start = service->kind == MessageKind::kStart;
  decoded.read_sensors = service->kind == MessageKind::kRequest;
  decoded.has_actuators = service->has_actuators;
  if (dialect == Dialect::kHardened) decoded.stamp = LoadStamp(payload);
  message = decoded;
  return MessageStatus::kOk;
}

MessageStatus DecodeSensors(std::span<const std::uint8_t> payload, Sensors& sensors) {
  if (payload.size() != kSensorMessageBytes) return MessageStatus::kBadLength;
  const MessageStatus status = CheckValues(payload.data(), kSensorLimitBits);
  return status == MessageStatus::kOk ? ParseSensors(payload, sensors) : status;
}

MessageStatus DecodeReference(std::span<const std::uint8_t> payload, Reference& reference) {
  if (payload.size() != kReferenceMessageBytes) return MessageStatus::kBadLength;
  const MessageStatus status = CheckValues(payload.data(), kReferenceLimitBits);
  if (status == MessageStatus::kOk) LoadFields(payload.data(), kReferenceFields, reference);
  return status;
}

bool IsPlausible(const Sensors& sensors) {
  for (std::size_t i = 0; i < kSensorCount; ++i) {
    if (MagnitudeBits(Bits(sensors.*kSensorFields[i].in_float)) > kSensorLimitBits[i]) return false;
  }
  return true;
}

MessageStatus ParseSensors(std::span<const std::uint8_t> payload, Sensors& sensors) {
  if (payload.size() != kSensorMessageBytes) return MessageStatus::kBadLength;
  LoadFields(payload.data(), kSensorFields, sensors);
  return MessageStatus::kOk;
}

MessageStatus DecodeSensorsPartly(std::span<const std::uint8_t> payload, std::size_t refused_max,
                                  Sensors& sensors) {
  Sensors decoded;
  const MessageStatus status = ParseSensors(payload, decoded);
  if (status != MessageStatus::kOk) return status;
  std::size_t refused = 0;
  for (std::size_t i = 0; i < kSensorCount; ++i) {
    float& value = decoded.*kSensorFields[i].in_float;
    if (MagnitudeBits(Bits(value)) <= kSensorLimitBits[i]) continue;
    value = std::numeric_limits<float>::quiet_NaN();
    if (++refused > refused_max) return MessageStatus::kNotFinite;
  }
  sensors = decoded;
  return MessageStatus::kOk;
}

MessageKind ClassifyClientPayload(Dialect dialect, std::span<const std::uint8_t> payload) {
  const Service* service = nullptr;
  return FindService(dialect, payload, service) == MessageStatus::kOk ? service->kind : MessageKind::kUnknown;
}

}  // namespace tiltproof::link
