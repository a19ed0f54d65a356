// The checks that a frame can carry behind its payload, by their names in the RevEng catalogue of CRC algorithms
// (https://reveng.sourceforge.io/crc-catalogue/).
//
//   Checksum(CheckKind::kCrc16Ibm3740, "123456789") == 0x29B1
//
// A check is sent with its low byte first, as in RFC 1662 and Ethernet. CRC-16/IBM-3740 processes the highest bit of a
// byte first, and is sent with its high byte first: only in the order in which the bits were divided does a CRC detect
// every burst that is not longer than the check.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace tiltproof::link {

enum class CheckKind : std::uint8_t {
  kFletcher16,
  kCrc16Ibm3740,
  kCrc16IbmSdlc,
  kCrc32IsoHdlc,
  kSum8,
  kNone,
};
constexpr CheckKind LastOf(CheckKind) { return CheckKind::kNone; }
std::string_view Name(CheckKind kind);  // "crc16_ibm_3740"

inline constexpr std::size_t kCheckBytesMax = 4;
// Length of the check: 0 to kCheckBytesMax.
std::size_t CheckBytes(CheckKind kind);

// The check of any number of bytes; 0 for kNone.
std::uint32_t Checksum(CheckKind kind, std::span<const std::uint8_t> bytes);

// Byte `i` of the check in the order in which its bytes are sent; i is below CheckBytes().
std::uint8_t CheckByte(CheckKind kind, std::uint32_t check, std::size_t i);
// The check of which these are all bytes.
std::uint32_t LoadCheck(CheckKind kind, std::span<const std::uint8_t> bytes);

// Changes of a payload that a check does not detect.
struct BlindSpot {
  std::size_t bytes_count = 0;   // that change, one behind the other; 0: no such change is known
  std::uint32_t ways_count = 0;  // in which they can change
};
BlindSpot BlindSpotOf(CheckKind kind);
// Makes such a change in `bytes`, which has BlindSpotOf(kind).bytes_count of them; `way` is below ways_count. It
// returns a text for a person: "by 7, ...".
std::string ChangeUnseen(CheckKind kind, std::span<std::uint8_t> bytes, std::uint32_t way);

}  // namespace tiltproof::link
