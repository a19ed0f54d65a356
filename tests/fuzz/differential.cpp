#include "tests/fuzz/differential.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>

namespace tiltproof::testing {
namespace {

using link::FrameStatus;

static_assert(kSlowPayloadLimit == link::kPayloadBytesMax);

FrameStatus Translate(SlowStatus status) {
  switch (status) {
    case SlowStatus::kAccepted:
      return FrameStatus::kOk;
    case SlowStatus::kWrongCheck:
      return FrameStatus::kBadChecksum;
    case SlowStatus::kOneByte:
      return FrameStatus::kTooShort;
    case SlowStatus::kOverlong:
      return FrameStatus::kTooLong;
    case SlowStatus::kCutEscape:
      return FrameStatus::kDanglingEscape;
    case SlowStatus::kNoPayload:
      return FrameStatus::kEmpty;
    case SlowStatus::kUnfinished:
      return FrameStatus::kAborted;
    case SlowStatus::kHeadless:
      return FrameStatus::kNoOpeningFlag;
  }
  return FrameStatus::kOk;
}

SeenEvent Copy(const link::FrameEvent& event) {
  return {event.status, Bytes(event.payload.begin(), event.payload.end()), event.begin, event.end};
}

std::string Describe(const std::vector<SeenEvent>& events) {
  std::string text;
  for (const SeenEvent& event : events) {
    text += "  " + std::string(link::Name(event.status)) + " [" + std::to_string(event.begin) + ", " +
            std::to_string(event.end) + ") " + Hex(event.payload) + "\n";
  }
  return text;
}

}  // namespace

std::string Hex(std::span<const std::uint8_t> bytes) {
  constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  for (const std::uint8_t byte : bytes) {
    text += kDigits[byte >> 4];
    text += kDigits[byte & 0xF];
  }
  return text;
}

Bytes FromHex(std::string_view text) {
  Bytes bytes;
  for (; text.size() >= 2; text.remove_prefix(2)) {
    std::uint8_t byte = 0;
    std::from_chars(text.data(), text.data() + 2, byte, 16);
    bytes.push_back(byte);
  }
  return bytes;
}

void Feed(link::FrameDecoder& decoder, std::span<const std::uint8_t> stream, const Chunking& chunking,
          std::vector<SeenEvent>& events) {
  std::size_t turn = 0;
  do {
    std::size_t count = stream.size();
    if (!chunking.empty()) count = std::min(count, chunking[turn++ % chunking.size()]);
    // A copy of its own length, so that a sanitizer sees a read past the chunk.
    const Bytes chunk(stream.begin(), stream.begin() + static_cast<std::ptrdiff_t>(count));
    stream = stream.subspan(count);
    std::span<const std::uint8_t> rest = chunk;
    while (const auto event = decoder.Next(rest)) events.push_back(Copy(*event));
  } while (!stream.empty());
}

std::vector<SeenEvent> Decode(std::span<const std::uint8_t> stream, const Chunking& chunking) {
  link::FrameDecoder decoder;
  std::vector<SeenEvent> events;
  Feed(decoder, stream, chunking, events);
  if (const auto event = decoder.Finish()) events.push_back(Copy(*event));
  return events;
}

std::vector<SeenEvent> SlowEvents(const Bytes& stream, std::size_t origin) {
  std::vector<SeenEvent> events;
  for (SlowEvent& event : SlowDecode(stream, origin)) {
    events.push_back({Translate(event.status), std::move(event.payload), event.begin, event.end});
  }
  return events;
}

std::string Disagreement(const std::vector<Bytes>& streams, const Chunking& chunking) {
  link::FrameDecoder decoder;
  std::array<std::uint32_t, link::kFrameStatusCount> counts{};
  std::size_t origin = 0;
  for (const Bytes& stream : streams) {
    std::vector<SeenEvent> seen;
    Feed(decoder, stream, chunking, seen);
    if (const auto event = decoder.Finish()) seen.push_back(Copy(*event));
    const std::vector<SeenEvent> expected = SlowEvents(stream, origin);
    for (const SeenEvent& event : expected) ++counts[static_cast<std::size_t>(event.status)];
    if (seen != expected || decoder.Counts() != counts) {
      return "stream " + Hex(stream) + "\ndecoder:\n" + Describe(seen) + "reference:\n" + Describe(expected);
    }
    origin += stream.size();
  }
  return {};
}

}  // namespace tiltproof::testing
