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
// The dialect `hardened` has the messages of `paper`. Each begins with a header of 7 bytes: its id in one byte (start 1,
// read sensors 2, actuators 3, sensors 4, reference 5), a sequence number in two and the sender's time in microseconds
// in four. The check of its frames is CRC-32 (link/frame.h). A receiver refuses what is not newer than what it accepted
// last (HeaderFilter).
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
#include <optional>
#include <span>
#include <string_view>

#include "firmware/signals.h"
#include "link/message_kind.h"

namespace tiltproof::link {

enum class Dialect : std::uint8_t { kPaper, kProvant, kHardened };
std::string_view Name(Dialect dialect);
// Number and time of a message of `hardened`; both wrap. The number counts the messages of its type that their sender
// has sent since its power-on, from 0.
struct Stamp {
  std::uint16_t sequence = 0;
  std::uint32_t time_us = 0;
  friend bool operator==(const Stamp&, const Stamp&) = default;
};

// A client's request to the server. `start` with `has_actuators` is provant's id 3.
struct ClientMessage {
  bool start = false;
  bool read_sensors = false;
  bool has_actuators = false;
  Actuators actuators;
  Stamp stamp = {};  // 0 in dialects without
  friend bool operator==(const ClientMessage&, const ClientMessage&) = default;
};

inline constexpr std::size_t kIdBytes = 4;
inline constexpr std::size_t kActuatorMessageBytes = kIdBytes + 4 * kActuatorCount;
inline constexpr std::size_t kSensorMessageBytes = 4 * kSensorCount;
inline constexpr std::size_t kReferenceMessageBytes = 4 * kReferenceCount;
inline constexpr std::size_t kHardenedHeaderBytes = 7;
inline constexpr std::size_t kMessageBytesMax = kHardenedHeaderBytes + kSensorMessageBytes;

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
MessageBytes EncodeSensors(const Sensors& sensors, Dialect dialect = Dialect::kPaper);
MessageBytes EncodeReference(const Reference& reference, Dialect dialect = Dialect::kPaper);
// Puts number and time into a message of `hardened`, which is encoded with zeros; leaves other dialects alone.
void SetStamp(Dialect dialect, Stamp stamp, MessageBytes& message);

// Takes the server's messages of one kind, sensors or references, without their header.
//
//   HeaderFilter filter(dialect, MessageKind::kReply);
//   if (const auto values = filter.Values(payload))
//     if (DecodeSensors(*values, sensors) == MessageStatus::kOk) filter.Accept();
//
// A message of `hardened` is newer than the last accepted one if its number is ahead by less than half of all numbers, and
// its time is not behind.
class HeaderFilter {
 public:
  HeaderFilter(Dialect dialect, MessageKind kind) : dialect_(dialect), kind_(kind) {}

  // The floats, for the functions below: all of the payload in dialects without header. nullopt when the payload is
  // shorter than the header, has another id, or is not newer.
  std::optional<std::span<const std::uint8_t>> Values(std::span<const std::uint8_t> payload);
  // The last payload that had values has been accepted.
  void Accept() { accepted_ = seen_; }

 private:
  bool IsNewer(Stamp stamp) const;

  Dialect dialect_;
  MessageKind kind_;
  std::optional<Stamp> seen_, accepted_;
};

// Each sets its output only when it returns kOk. The payloads of the server's messages are without header. When there are several violations, it returns the first in this list:
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
