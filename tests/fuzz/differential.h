// FrameDecoder against the slow reference on one stream: what the fuzz target, the stress driver and the unit
// tests share.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "link/frame.h"
#include "tests/support/slow_codec.h"

namespace tiltproof::testing {

// One event that a decoder reported, copied out of it.
struct SeenEvent {
  link::FrameStatus status;
  Bytes payload;
  std::uint64_t begin;
  std::uint64_t end;
  friend bool operator==(const SeenEvent&, const SeenEvent&) = default;
};

// The cuts of a stream before it is fed: chunk lengths in bytes, used in turn and repeated; 0 feeds an empty
// chunk. At least one is not zero; none = the whole stream at once.
using Chunking = std::vector<std::size_t>;

// Feeds the stream in chunks, appends the events, without Finish().
void Feed(link::FrameDecoder& decoder, std::span<const std::uint8_t> stream, const Chunking& chunking,
          std::vector<SeenEvent>& events);

// All events of a fresh decoder for the stream, the one of Finish() included.
std::vector<SeenEvent> Decode(std::span<const std::uint8_t> stream, const Chunking& chunking = {});

// The same events, as the reference tells them.
std::vector<SeenEvent> SlowEvents(const Bytes& stream, std::size_t origin = 0);

// Empty when a fresh decoder, fed with the streams one after another in these chunks and finished after each,
// tells what the reference tells, and counts what it told; else what differs, with the stream in hex.
std::string Disagreement(const std::vector<Bytes>& streams, const Chunking& chunking);

// Lower-case hex, and back: two digits a byte and nothing else.
std::string Hex(std::span<const std::uint8_t> bytes);
Bytes FromHex(std::string_view text);

}  // namespace tiltproof::testing
