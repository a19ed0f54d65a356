// CRC-32/ISO-HDLC, as RevEng's catalogue of CRC algorithms names it: the check of Ethernet, zlib and RFC 1662.
//
//   Crc32("123456789") == 0xCBF43926
#pragma once

#include <cstdint>
#include <span>

namespace tiltproof::link {

// Any number of bytes.
std::uint32_t Crc32(std::span<const std::uint8_t> bytes);

}  // namespace tiltproof::link
