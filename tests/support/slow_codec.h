// A second, slow frame codec, written only from the protocol's description, to check link/frame.h.
//
// It shares no code with the product and is built another way round: it takes a whole stream at once, cuts it
// at the flags, undoes the escapes of each piece, and computes the check with a division a byte. Statuses are
// its own.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace tiltproof::testing {

using Bytes = std::vector<std::uint8_t>;

enum class SlowStatus {
  kAccepted,
  kWrongCheck,
  kOneByte,
  kOverlong,
  kCutEscape,
  kNoPayload,
  kUnfinished,
  kHeadless
};

struct SlowEvent {
  SlowStatus status;
  Bytes payload;      // as FrameEvent::payload
  std::size_t begin;  // as FrameEvent::begin
  std::size_t end;    // as FrameEvent::end
};

// Longest payload of a frame, in bytes.
inline constexpr std::size_t kSlowPayloadLimit = 256;

// The check's two bytes in the order in which they are sent: the sum of the bytes, and the sum of its running
// values, modulo 255.
Bytes SlowCheck(const Bytes& payload);

// The frame of a payload of any length.
Bytes SlowEncode(const Bytes& payload);

// Everything a receiver has to tell about a stream that begins with its first byte at offset `origin` and
// then ends.
std::vector<SlowEvent> SlowDecode(const Bytes& stream, std::size_t origin = 0);

}  // namespace tiltproof::testing
