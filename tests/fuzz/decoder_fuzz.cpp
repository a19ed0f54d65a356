// FrameDecoder alone, as fast as it goes: what must hold for the events of any stream in any chunks. Which events
// they should be is the matter of decoder_differential_fuzz.cpp.
//
// Input: the first byte is the length of a chunk; the rest is the stream.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

#include "link/frame.h"
#include "tests/fuzz/fuzz_target.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using tiltproof::testing::Require;
  namespace link = tiltproof::link;
  if (size == 0) return 0;
  const std::size_t chunk_bytes = data[0] == 0 ? size : data[0];

  link::FrameDecoder decoder;
  std::uint64_t events_count = 0, end = 0;
  const auto check = [&](const link::FrameEvent& event) {
    ++events_count;
    Require(event.begin < event.end && event.end >= end, "events come in order");
    end = event.end;
    Require(event.payload.size() <= link::kPayloadBytesMax, "a payload keeps its limit");
    if (event.status != link::FrameStatus::kOk) return;
    // Two flags and two bytes of the check.
    Require(!event.payload.empty() && event.payload.size() + 4 <= event.end - event.begin,
            "an accepted frame holds its payload");
  };
  for (std::span<const std::uint8_t> rest(data + 1, size - 1); !rest.empty();) {
    auto chunk = rest.first(std::min(chunk_bytes, rest.size()));
    rest = rest.subspan(chunk.size());
    while (const auto event = decoder.Next(chunk)) check(*event);
    Require(chunk.empty(), "a chunk is consumed");
  }
  if (const auto event = decoder.Finish()) check(*event);
  Require(end < size, "events lie in the stream");
  std::uint64_t counted = 0;
  for (const std::uint32_t count : decoder.Counts()) counted += count;
  Require(counted == events_count, "events are counted");
  return 0;
}
