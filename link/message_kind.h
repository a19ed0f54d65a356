// Payloads: their longest, the kinds of messages in them, and what is wrong with one that is no message.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace tiltproof::link {

// Longest payload of a frame, in bytes. The paper's longest is 132.
inline constexpr std::size_t kPayloadBytesMax = 256;

// The role of a message. kRequest asks for the sensors, kReply is the server's answer, the server sends kStreamed by
// itself, and kOther has no effect.
enum class MessageKind : std::uint8_t {
  kStart,
  kRequest,
  kActuators,
  kReply,
  kReference,
  kStreamed,
  kOther,
  kUnknown
};
std::string_view Name(MessageKind kind);

// kStale: its number or time is not newer than that of the message of its type before it.
enum class MessageStatus : std::uint8_t { kOk, kBadLength, kUnknownId, kNotFinite, kOutOfRange, kStale };
inline constexpr std::size_t kMessageStatusCount = 6;
std::string_view Name(MessageStatus status);

}  // namespace tiltproof::link
