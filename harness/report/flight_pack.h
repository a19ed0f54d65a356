// A flight's view as bytes for the page (harness/report/page/src/data.js reads them): compressed, within a limit.
//
//   const std::string bytes = PackFlight(view, {});
//
// Layout: a size (uint32, little endian), that many bytes of zlib, then the close-ups, each zlib of its own, whose places
// the first part tells. Uncompressed, each part is the size of a JSON text, the text, and numbers that it refers to.
//
// A close-up is a quarter of a second with every row of the trace, exactly, and every frame of the lines. They surround
// what a person looks for (MomentsOf), nearest first, until they reach the limit.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "harness/report/flight_view.h"

namespace tiltproof::harness {

struct PackLimits {
  std::size_t points_max = 1'500;           // per series
  std::size_t close_up_bytes_max = 100'000;  // compressed, all of a flight
};
inline constexpr TimeNs kCloseUp_ns = kNsPerS / 4;
// How far close-ups reach around a moment.
inline constexpr TimeNs kReach_ns = 2 * kNsPerS;

std::string PackFlight(const FlightView& view, const PackLimits& limits);

// Of zlib, as DecompressionStream('deflate') reads it.
std::string Deflate(std::string_view bytes);

}  // namespace tiltproof::harness
