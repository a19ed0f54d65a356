// A slow second model of a UART, from the definition of its characters: the levels of the line, one for each bit time.
//
//   const std::vector<bool> levels = Levels(0x41, {8, 'E', 1});   // start, 8 data bits, parity, stop
//   const HeardCharacter heard = Hear(levels, {8, 'E', 1});
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "link/character.h"

namespace tiltproof {

struct UartFormat {
  int data_bits = 8;
  char parity = 'N';  // or 'E', 'O'
  int stop_bits = 1;

  link::CharacterFormat ForLink() const {
    return {.data_bits = data_bits,
            .parity = parity == 'E'   ? link::Parity::kEven
                      : parity == 'O' ? link::Parity::kOdd
                                      : link::Parity::kNone,
            .stop_bits = stop_bits};
  }
};

inline std::vector<UartFormat> AllUartFormats() {
  std::vector<UartFormat> all;
  for (const int data_bits : {7, 8})
    for (const char parity : {'N', 'E', 'O'})
      for (const int stop_bits : {1, 2}) all.push_back({data_bits, parity, stop_bits});
  return all;
}

inline std::vector<bool> Levels(unsigned byte, const UartFormat& format) {
  std::vector<bool> levels = {false};
  int ones = 0;
  for (int bit = 0; bit < format.data_bits; ++bit) {
    const bool one = byte / (1U << bit) % 2 == 1;
    levels.push_back(one);
    if (one) ++ones;
  }
  // The parity bit makes the number of ones even, or odd.
  if (format.parity == 'E') levels.push_back(ones % 2 == 1);
  if (format.parity == 'O') levels.push_back(ones % 2 == 0);
  for (int bit = 0; bit < format.stop_bits; ++bit) levels.push_back(true);
  return levels;
}

struct HeardCharacter {
  unsigned byte = 0;
  bool parity_error = false, framing_error = false;
};

// Levels from the start bit on.
inline HeardCharacter Hear(const std::vector<bool>& levels, const UartFormat& format) {
  HeardCharacter heard;
  std::size_t at = 1;
  int ones = 0;
  for (int bit = 0; bit < format.data_bits; ++bit, ++at) {
    if (!levels.at(at)) continue;
    heard.byte += 1U << bit;
    ++ones;
  }
  if (format.parity != 'N') {
    if (levels.at(at++)) ++ones;
    heard.parity_error = ones % 2 != (format.parity == 'E' ? 0 : 1);
  }
  heard.framing_error = !levels.at(at);
  return heard;
}

}  // namespace tiltproof
