// All readings of a stream of bytes, for tests that compare readers, or the chunks that a reader gets.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "link/framing.h"

namespace tiltproof::testing {

// A FrameReading that outlives its reader.
struct Read {
  std::string status;
  std::vector<std::uint8_t> payload;
  std::uint64_t begin, end, content_begin, content_end;
  friend bool operator==(const Read&, const Read&) = default;
};

// `check` gets each reading while it is valid.
template <class Check>
std::vector<Read> ReadAll(const link::Framing& framing, std::span<const std::uint8_t> stream,
                          std::size_t piece, const Check& check) {
  std::vector<Read> all;
  const auto take = [&](const link::FrameReading& reading) {
    check(reading);
    all.push_back({std::string(reading.status),
                   {reading.payload.begin(), reading.payload.end()},
                   reading.begin,
                   reading.end,
                   reading.content_begin,
                   reading.content_end});
  };
  const auto reader = framing.MakeReader();
  for (std::size_t at = 0; at < stream.size(); at += piece) {
    auto bytes = stream.subspan(at, std::min(piece, stream.size() - at));
    while (const auto reading = reader->Next(bytes)) take(*reading);
  }
  if (const auto reading = reader->Finish()) take(*reading);
  return all;
}

}  // namespace tiltproof::testing
