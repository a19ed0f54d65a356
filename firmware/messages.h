// The high-level protocol (paper, section 2.1, Figure 3): what the payloads mean. Floats are IEEE-754
// binary32, little endian.
//
// The client (firmware) leads. Its messages begin with a service id, a float:
//   dialect   start   read sensors   actuators   actuators + un-pause
//   paper       1          2             3                -
//   provant     -          1             0                3          (the authors' published server)
// `start` and `read sensors` consist only of the id (4 bytes), the actuator messages have 4 more floats (20
// bytes). The server's only message is the reply to `read sensors`: 16 floats without id (64 bytes). On the
// second line a reference is 7 floats (28 bytes).
//
// A payload contains neither its direction nor its dialect: the receiver knows both. The server reads what
// arrives to_plant only with DecodeClientMessage(), the client reads what arrives to_client with
// DecodeSensors() and the reference line with DecodeReference(). A reply that is echoed back to the server is
// an unknown id to it.
//
// Fletcher-16 lets wrong payloads through (00 <-> FF), so a message is accepted only with exact length, known
// id, and every value finite and within the plausible range below; every violation is a value of
// MessageStatus, never undefined behaviour.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "firmware/signals.h"
#include "link/message_kind.h"

namespace tiltproof::link {

enum class Dialect : std::uint8_t { kPaper, kProvant };
std::string_view Name(Dialect dialect);

// A client's request to the server. `start` with `has_actuators` is provant's id 3.
struct ClientMessage {
  bool start = false;
  bool read_sensors = false;
  bool has_actuators = false;
  Actuators actuators;
  friend bool operator==(const ClientMessage&, const ClientMessage&) = default;
};

inline constexpr std::size_t kIdBytes = 4;
inline constexpr std::size_t kActuatorMessageBytes = kIdBytes + 4 * kActuatorCount;
inline constexpr std::size_t kSensorMessageBytes = 4 * kSensorCount;
inline constexpr std::size_t kReferenceMessageBytes = 4 * kReferenceCount;
inline constexpr std::size_t kMessageBytesMax = kSensorMessageBytes;

// Beyond these magnitudes a value is not a state of a small aircraft but a damaged message. The limit itself
// is in range.
inline constexpr float kPositionMax_m = 1e4F;
inline constexpr float kAngleMax_rad = 100.0F;  // unwrapped yaw included
inline constexpr float kVelocityMax_m_s = 1e3F;
inline constexpr float kAngularRateMax_rad_s = 1e3F;
inline constexpr float kForceMax_n = 1e3F;
inline constexpr float kTorqueMax_nm = 1e2F;

// A fixed buffer with the bytes in use.
struct MessageBytes {
  std::array<std::uint8_t, kMessageBytesMax> bytes{};
  std::size_t size = 0;
  std::span<const std::uint8_t> span() const { return {bytes.data(), size}; }
};

// Values are sent unchanged, even if not finite or out of range: the sender is responsible for them.
MessageBytes EncodeStart(Dialect dialect,
                         const Actuators& hover);  // paper: id 1; provant: id 3 with the hover input
MessageBytes EncodeReadSensors(Dialect dialect);
MessageBytes EncodeActuators(Dialect dialect, const Actuators& actuators);
MessageBytes EncodeSensors(const Sensors& sensors);
MessageBytes EncodeReference(const Reference& reference);

// Each sets its output only when it returns kOk. When there are several violations, it returns the first in this list:
// kBadLength (for a client message: shorter than an id), kUnknownId (any other bit pattern: -0.0 is not 0.0),
// kBadLength (of the id's message), kNotFinite (anywhere), kOutOfRange.
MessageStatus DecodeClientMessage(Dialect dialect, std::span<const std::uint8_t> payload,
                                  ClientMessage& message);
MessageStatus DecodeSensors(std::span<const std::uint8_t> payload, Sensors& sensors);
MessageStatus DecodeReference(std::span<const std::uint8_t> payload, Reference& reference);
// True if DecodeSensors() would accept these values.
bool IsPlausible(const Sensors& sensors);
// DecodeSensors() without the checks of values: exact length only, any bit pattern goes through unchanged.
// For firmware that trusts the checksum, as the paper's does.
MessageStatus ParseSensors(std::span<const std::uint8_t> payload, Sensors& sensors);

// ParseSensors() for firmware that does without single signals: a value that DecodeSensors() would refuse becomes
// NaN. kNotFinite when they are more than `refused_max`: that is a damaged message.
MessageStatus DecodeSensorsPartly(std::span<const std::uint8_t> payload, std::size_t refused_max,
                                  Sensors& sensors);

// The kind of a payload sent by the client, judged only by length and id; kUnknown when it is no message.
// provant's id 3 is kStart each time it comes.
MessageKind ClassifyClientPayload(Dialect dialect, std::span<const std::uint8_t> payload);

}  // namespace tiltproof::link
