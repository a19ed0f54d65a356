// Fletcher-16 (Fletcher 1982; paper, section 2.1): two sums modulo 255, sum1 in the low byte of the result.
//
// sum1 is the sum of the bytes, sum2 the sum of all values that sum1 took; both start at 0, so the checksum
// of no bytes is 0. Modulo 255 the bytes 00 and FF are the same number, so a byte that changes between them
// keeps the checksum: users must also check length and ranges (firmware/messages.h).
//
//   Fletcher16("abcde") == 0xC8F0
#pragma once

#include <cstdint>
#include <span>

namespace tiltproof::link {

inline constexpr std::uint32_t kFletcherModulus = 255;

// Any number of bytes; both bytes of the result are in [0, 254].
std::uint16_t Fletcher16(std::span<const std::uint8_t> bytes);

}  // namespace tiltproof::link
