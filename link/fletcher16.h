// Fletcher-16 (Fletcher 1982; paper, section 2.1): two sums modulo 255, sum1 in the low byte of the result.
//
// Modulo 255 the bytes 00 and FF are the same number, so a byte that flips between them keeps the checksum: whoever uses
// this must check length and ranges too (link/messages.h).
#pragma once

#include <cstdint>
#include <span>

namespace tiltproof::link {

std::uint16_t Fletcher16(std::span<const std::uint8_t> bytes);

}  // namespace tiltproof::link
