// A flight's view as bytes for the page (harness/report/page/src/data.js reads them): compressed, within a limit.
//
//   const std::string bytes = PackFlight(view, {});
//
// Layout: a size (uint32, little endian) and that many bytes of zlib: the flight. The same again: the places of the
// close-ups. Then the close-ups, each zlib of its own. Uncompressed, each part is the size of a JSON text (uint32), the
// text, and numbers that it refers to.
//
// A close-up is a quarter of a second with every row of the trace, exactly, and every frame of the lines. They surround
// what a person looks for (MomentsOf), nearest first, until they reach the limit.
#pragma once

#include <cstddef>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

#include "harness/report/flight_view.h"

namespace tiltproof::harness {

struct PackLimits {
  std::size_t points_max = 1'500;            // per series
  std::size_t close_up_bytes_max = 100'000;  // compressed, all of a flight
  // Aim for the whole flight: close-ups fill what the rest leaves of it, but always get kCloseUpBytesMin.
  std::size_t bytes_aim = 1'000'000;
};
inline constexpr std::size_t kCloseUpBytesMin = 10'000;
inline constexpr TimeNs kCloseUp_ns = kNsPerS / 4;
// Reach of close-ups around a moment.
inline constexpr TimeNs kReach_ns = 2 * kNsPerS;

// Facts on a flight before it is flown: its scenario, its vehicle, bounds, and the columns of view.trace.
nlohmann::ordered_json HeadJson(const FlightView& view);

std::string PackFlight(const FlightView& view, const PackLimits& limits);

// Compresses into zlib's format, as DecompressionStream('deflate') reads it.
std::string Deflate(std::string_view bytes);

}  // namespace tiltproof::harness
