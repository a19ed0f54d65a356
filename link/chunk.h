// Bytes on a wire with their time: the unit that transports, filters and logs share.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "link/character.h"
#include "link/fields.h"
#include "link/time.h"

namespace tiltproof::link {

// A line and a direction. The main line carries sensors and actuators, the reference line only base station
// -> client.
enum class Direction : std::uint8_t { kToPlant, kToClient, kReference };
inline constexpr std::array kDirections = {Direction::kToPlant, Direction::kToClient, Direction::kReference};
inline constexpr std::size_t kDirectionCount = kDirections.size();
std::string_view Name(Direction direction);  // "to_plant", "to_client", "reference"
// The way back; the reference line has none.
constexpr std::optional<Direction> Opposite(Direction direction) {
  if (direction == Direction::kReference) return std::nullopt;
  return direction == Direction::kToPlant ? Direction::kToClient : Direction::kToPlant;
}

// A frame, or bytes, that are no message of the protocol.
inline constexpr std::uint8_t kNoMessage = 0xFF;

// On a line it has boot time, in the log of a flight simulation time.
template <class Time>
struct TimedChunk {
  Time begin_ns{};                    // when the start bit of the first byte enters the wire
  std::vector<std::uint8_t> bytes;    // back to back from there
  std::uint8_t message = kNoMessage;  // of the frame as sent: its place in the protocol's table
  // Number of the frame as sent, from 0 in its direction. The wire assigns it; copies and fragments keep it.
  std::uint64_t number = 0;
  // One for each byte: 1 where the parity bit does not fit the byte. Empty when all fit.
  std::vector<std::uint8_t> parity_errors = {};
  TILTPROOF_FIELDS(begin_ns, bytes, message, number, parity_errors)

  bool HasParityError(std::size_t byte) const { return !parity_errors.empty() && parity_errors[byte] != 0; }
  void Append(std::uint8_t byte, bool parity_error) {
    if (parity_error && parity_errors.empty()) parity_errors.resize(bytes.size());
    bytes.push_back(byte);
    if (parity_error || !parity_errors.empty()) parity_errors.push_back(parity_error ? 1 : 0);
  }
  // Appends a byte of another chunk, with the state of its parity bit.
  void Append(const TimedChunk& from, std::size_t byte) {
    Append(from.bytes[byte], from.HasParityError(byte));
  }
  // The bytes [from, to) of this chunk, as a chunk with its begin, message and number.
  TimedChunk Part(std::size_t from, std::size_t to) const {
    TimedChunk part{.begin_ns = begin_ns, .bytes = {}, .message = message, .number = number};
    for (std::size_t byte = from; byte < to; ++byte) part.Append(*this, byte);
    return part;
  }
};
using Chunk = TimedChunk<BootTime>;
using LogChunk = TimedChunk<TimeNs>;

// Limit of the total weight (WeightOf()) of the chunks that may wait in one direction of a line, on the wire
// and held back by faults. It is ten times the bytes that the usual messages send in a minute.
inline constexpr std::size_t kLineBytesMax = std::size_t{8} << 20;
// The weight of a chunk is its bytes and its overhead in memory.
inline constexpr std::size_t kChunkOverheadBytes = 64;
inline std::size_t WeightOf(const Chunk& chunk) {
  return chunk.bytes.size() + chunk.parity_errors.size() + kChunkOverheadBytes;
}

// Acts on what passes a wire, as the faults do. It gets each frame as sent, as one chunk, and leaves any number of
// chunks in the order in which they are to go on. The wire keeps that order and never lets two chunks overlap: it moves
// back a chunk that would begin before its predecessor ends.
class ChunkFilter {
 public:
  virtual ~ChunkFilter() = default;
  // When it turns a frame into more than kLineBytesMax, it may stop at once and leave the chunks made so far:
  // at most twice that limit. The wire then sends none of them.
  virtual void Apply(std::vector<Chunk>& chunks) = 0;
  // The total weight (WeightOf()) of the chunks that it keeps for later.
  virtual std::size_t held_bytes() const { return 0; }
};

}  // namespace tiltproof::link
