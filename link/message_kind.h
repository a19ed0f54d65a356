// Kinds of messages, and what is wrong with a payload that is no message.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace tiltproof::link {

// The names in scenario files (`message: actuators`). kRequest asks for the sensors, kReply is the server's answer.
enum class MessageKind : std::uint8_t { kStart, kRequest, kActuators, kReply, kReference, kUnknown };
std::string_view Name(MessageKind kind);

enum class MessageStatus : std::uint8_t { kOk, kBadLength, kUnknownId, kNotFinite, kOutOfRange };
inline constexpr std::size_t kMessageStatusCount = 5;
std::string_view Name(MessageStatus status);

}  // namespace tiltproof::link
