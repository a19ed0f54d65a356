// A character of an asynchronous serial line, and the time that characters take.
//
// A character is a start bit, the data bits with the lowest first, a parity bit where there is one, and the stop bits:
//
//   constexpr LineRate rate{.baud = 115'200, .character = {.data_bits = 8, .parity = Parity::kEven}};
//   BootTime arrival = begin + rate.BytesTime(1);        // 11 bits
//   bool level = rate.character.ParityBit(byte);         // true: the line is high
//
// A receiver of characters with parity notices an odd number of flipped bits, the parity bit included.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <string>
#include <string_view>

#include "link/time.h"

namespace tiltproof::link {

enum class Parity : std::uint8_t { kNone, kEven, kOdd };
inline constexpr std::array kParities = {Parity::kNone, Parity::kEven, Parity::kOdd};
std::string_view Name(Parity parity);  // "none", "even", "odd"

struct CharacterFormat {
  std::int64_t data_bits = 8;  // 7 or 8; a chip may also have 9
  Parity parity = Parity::kNone;
  std::int64_t stop_bits = 1;  // 1 or 2

  constexpr bool has_parity() const { return parity != Parity::kNone; }
  // Between start bit and stop bits: the bits that noise can change without moving the characters.
  constexpr std::int64_t content_bits() const { return data_bits + (has_parity() ? 1 : 0); }
  constexpr std::int64_t bit_count() const { return 1 + content_bits() + stop_bits; }
  // The part of a byte that its character carries.
  constexpr std::uint8_t Carried(std::uint8_t byte) const {
    return static_cast<std::uint8_t>(byte & ((1U << data_bits) - 1));
  }
  // The parity bit that belongs to the byte. Even: data bits and parity bit hold an even number of ones.
  constexpr bool ParityBit(std::uint8_t byte) const {
    return (std::popcount(Carried(byte)) % 2 != 0) != (parity == Parity::kOdd);
  }
  // The byte's data bits, lowest first, and behind them its parity bit.
  constexpr std::uint16_t WordOf(std::uint8_t byte, bool parity_error = false) const {
    const bool high = has_parity() && ParityBit(byte) != parity_error;
    return static_cast<std::uint16_t>(Carried(byte) | (high ? 1U << data_bits : 0));
  }
  friend bool operator==(const CharacterFormat&, const CharacterFormat&) = default;
};
std::string Name(const CharacterFormat& format);  // "8N1", "7E2"

// Time that a number of bytes takes on a line, rounded down to nanoseconds; baud 0 is an ideal line, where bytes take
// no time.
constexpr TimeNs BytesTime(std::int64_t baud, std::int64_t byte_count,
                           const CharacterFormat& character = {}) {
  return baud == 0 ? 0 : byte_count * character.bit_count() * kNsPerS / baud;
}

struct LineRate {
  static constexpr std::int64_t kUsualBaud = 921'600;

  std::int64_t baud = kUsualBaud;  // 0: ideal, bytes take no time
  CharacterFormat character = {};

  constexpr TimeNs BytesTime(std::int64_t byte_count) const {
    return link::BytesTime(baud, byte_count, character);
  }
  // Where the time of a byte within its frame matters, an ideal line has the paper's rate.
  constexpr LineRate OrUsual() const { return {baud == 0 ? kUsualBaud : baud, character}; }
};

}  // namespace tiltproof::link
