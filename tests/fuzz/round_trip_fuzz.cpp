// EncodeFrame and back: every payload that fits is what the reference encoder makes of it, and what the decoder
// finds in it; a wire that is too short stays as it is.
//
// Input: the first two bytes are how much shorter or longer the wire is than the longest frame; the rest is the
// payload.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

#include "link/frame.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/support/slow_codec.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using tiltproof::testing::Bytes;
  using tiltproof::testing::Require;
  namespace link = tiltproof::link;
  if (size < 2) return 0;
  const Bytes payload(data + 2, data + size);
  const Bytes expected = tiltproof::testing::SlowEncode(payload);

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
