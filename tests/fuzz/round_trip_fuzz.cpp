// EncodeFrame and back: every payload that fits is what the reference encoder makes of it, and what the decoder
// finds in it; a wire that is too short stays as it is. The check of a message of any length is that of the reference.
//
// Input: the first two bytes are how much shorter or longer the wire is than the longest frame; the rest is the
// payload.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

#include "link/fletcher16.h"
#include "link/frame.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/support/slow_codec.h"

namespace {

using tiltproof::testing::Bytes;
using tiltproof::testing::Require;
namespace link = tiltproof::link;

void RequireCheck(const Bytes& bytes) {
  const std::uint16_t check = link::Fletcher16(bytes);
  const Bytes expected = tiltproof::testing::SlowCheck(bytes);
  Require(expected.size() == 2 && (check & 0xFF) == expected[0] && check >> 8 == expected[1],
          "the check is that of the reference");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 2) return 0;
  const Bytes payload(data + 2, data + size);
  const Bytes expected = tiltproof::testing::SlowEncode(payload);

  RequireCheck(payload);
  // Sometimes far beyond a frame: there the sums are reduced in between.
  if (data[0] == 'l' && data[1] == 'l' && !payload.empty()) {
    Bytes longer;
    while (longer.size() < 6'000) longer.insert(longer.end(), payload.begin(), payload.end());
    RequireCheck(longer);
  }

  constexpr std::uint8_t kUntouched = 0xA5;
  Bytes wire(
      (std::size_t{data[0]} | std::size_t{data[1]} << 8) % (link::FrameBytesMax(link::kPayloadBytesMax) + 8),
      kUntouched);
  const auto frame = link::EncodeFrame(payload, wire);
  const bool fits = payload.size() <= link::kPayloadBytesMax && expected.size() <= wire.size();
  Require(frame.ok() == fits, "a frame is made when it fits");
  const auto rest = wire.begin() + static_cast<std::ptrdiff_t>(frame.bytes.size());
  Require(std::all_of(rest, wire.end(), [](auto byte) { return byte == kUntouched; }),
          "the rest is untouched");
  if (!fits) return 0;
  Require(std::ranges::equal(frame.bytes, expected), "encoder and reference agree");

  link::FrameDecoder decoder;
  std::span<const std::uint8_t> received = frame.bytes;
  const auto event = decoder.Next(received);
  Require(event.has_value() && event->end == frame.bytes.size(), "a frame is an event, at its end");
  const auto status = payload.empty() ? link::FrameStatus::kEmpty : link::FrameStatus::kOk;
  Require(event->status == status && std::ranges::equal(event->payload, payload), "a payload comes back");
  Require(!decoder.Next(received) && !decoder.Finish(), "and nothing else");
  return 0;
}
