#include "link/checksum.h"

#include <array>

#include "link/check.h"
#include "link/fletcher16.h"

namespace tiltproof::link {
namespace {

constexpr std::uint32_t kIbm3740Polynomial = 0x1'1021, kSdlcPolynomial = 0x1'1021;
constexpr std::uint64_t kIsoHdlcPolynomial = 0x1'04C1'1DB7;

// Remainders of a byte that has 0 to 7 zero bytes behind it: eight bytes are divided at once (M. Kounavis and F. Berry,
// Novel Table Lookup-Based Algorithms for High-Performance CRC Generation, IEEE Transactions on Computers 57(11), 2008).
// The register has 32 bits. A CRC of 16 bits is in its upper half, or in its lower half when it is reflected: the lowest
// bit of a byte is divided first.
using CrcTables = std::array<std::array<std::uint32_t, 256>, 8>;

template <bool kReflected>
constexpr std::uint32_t DivideByte(std::uint32_t rest, const CrcTables& tables) {
  return kReflected ? rest >> 8 ^ tables[0][rest & 0xFF] : rest << 8 ^ tables[0][rest >> 24];
}

template <bool kReflected>
constexpr CrcTables MakeCrcTables(std::uint32_t polynomial) {
  CrcTables tables{};
  for (std::uint32_t byte = 0; byte < 256; ++byte) {
    std::uint32_t rest = kReflected ? byte : byte << 24;
    for (int bit = 0; bit < 8; ++bit)
      rest = kReflected ? rest >> 1 ^ ((rest & 1) != 0 ? polynomial : 0)
                        : rest << 1 ^ (rest >> 31 != 0 ? polynomial : 0);
    tables[0][byte] = rest;
  }
  for (std::size_t zeros = 1; zeros < tables.size(); ++zeros)
    for (std::size_t byte = 0; byte < 256; ++byte)
      tables[zeros][byte] = DivideByte<kReflected>(tables[zeros - 1][byte], tables);
  return tables;
}

constexpr CrcTables kIbm3740 = MakeCrcTables<false>(0x1021U << 16);
constexpr CrcTables kIbmSdlc = MakeCrcTables<true>(0x8408);  // 0x1021, reflected
constexpr CrcTables kIsoHdlc = MakeCrcTables<true>(0xEDB8'8320);

// Four bytes as one number, in the order in which they are divided.
template <bool kReflected>
std::uint32_t LoadFour(const std::uint8_t* bytes) {
  std::uint32_t number = 0;
  for (int i = 0; i < 4; ++i) number |= std::uint32_t{bytes[i]} << (kReflected ? 8 * i : 24 - 8 * i);
  return number;
}

// The remainder of the bytes, from `rest` on.
template <bool kReflected>
std::uint32_t Divide(const CrcTables& tables, std::uint32_t rest, std::span<const std::uint8_t> bytes) {
  const auto part = [](std::uint32_t number, int i) {
    return number >> (kReflected ? 8 * i : 24 - 8 * i) & 0xFF;
  };
  const std::uint8_t* at = bytes.data();
  std::size_t left = bytes.size();
  for (; left >= 8; left -= 8, at += 8) {
    const std::uint32_t first = rest ^ LoadFour<kReflected>(at), second = LoadFour<kReflected>(at + 4);
    rest = tables[7][part(first, 0)] ^ tables[6][part(first, 1)] ^ tables[5][part(first, 2)] ^
           tables[4][part(first, 3)] ^ tables[3][part(second, 0)] ^ tables[2][part(second, 1)] ^
           tables[1][part(second, 2)] ^ tables[0][part(second, 3)];
  }
  for (; left > 0; --left, ++at)
    rest = DivideByte<kReflected>(rest ^ (kReflected ? *at : std::uint32_t{*at} << 24), tables);
  return rest;
}

bool IsHighFirst(CheckKind kind) { return kind == CheckKind::kCrc16Ibm3740; }

std::uint8_t Reversed(std::uint8_t byte) {
  std::uint8_t reversed = 0;
  for (int bit = 0; bit < 8; ++bit) reversed |= static_cast<std::uint8_t>((byte >> bit & 1) << (7 - bit));
  return reversed;
}

// A CRC does not detect a multiple of its polynomial, here its product with x^way. `is_reflected`: the lowest bit of a
// byte is divided first.
void ChangeByPolynomial(std::uint64_t polynomial, bool is_reflected, std::uint32_t way,
                        std::span<std::uint8_t> bytes) {
  const std::uint64_t change = polynomial << way;
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    const auto part = static_cast<std::uint8_t>(change >> 8 * (bytes.size() - 1 - i) & 0xFF);
    bytes[i] ^= is_reflected ? Reversed(part) : part;
  }
}

}  // namespace

std::string_view Name(CheckKind kind) {
  switch (kind) {
    case CheckKind::kFletcher16:
      return "fletcher16";
    case CheckKind::kCrc16Ibm3740:
      return "crc16_ibm_3740";
    case CheckKind::kCrc16IbmSdlc:
      return "crc16_ibm_sdlc";
    case CheckKind::kCrc32IsoHdlc:
      return "crc32_iso_hdlc";
    case CheckKind::kSum8:
      return "sum8";
    case CheckKind::kNone:
      return "none";
  }
  return "unknown";
}

std::size_t CheckBytes(CheckKind kind) {
  switch (kind) {
    case CheckKind::kFletcher16:
    case CheckKind::kCrc16Ibm3740:
    case CheckKind::kCrc16IbmSdlc:
      return 2;
    case CheckKind::kCrc32IsoHdlc:
      return 4;
    case CheckKind::kSum8:
      return 1;
    case CheckKind::kNone:
      return 0;
  }
  ThrowBrokenInvariant("a kind of check");
}

std::uint32_t Checksum(CheckKind kind, std::span<const std::uint8_t> bytes) {
  switch (kind) {
    case CheckKind::kFletcher16:
      return Fletcher16(bytes);
    case CheckKind::kCrc16Ibm3740:
      return Divide<false>(kIbm3740, 0xFFFF'0000, bytes) >> 16;
    case CheckKind::kCrc16IbmSdlc:
      return Divide<true>(kIbmSdlc, 0xFFFF, bytes) ^ 0xFFFF;
    case CheckKind::kCrc32IsoHdlc:
      return ~Divide<true>(kIsoHdlc, 0xFFFF'FFFF, bytes);
    case CheckKind::kSum8: {
      std::uint32_t sum = 0;
      for (const std::uint8_t byte : bytes) sum += byte;
      return sum & 0xFF;
    }
    case CheckKind::kNone:
      return 0;
  }
  ThrowBrokenInvariant("a kind of check");
}

std::uint8_t CheckByte(CheckKind kind, std::uint32_t check, std::size_t i) {
  const std::size_t byte = IsHighFirst(kind) ? CheckBytes(kind) - 1 - i : i;
  return static_cast<std::uint8_t>(check >> 8 * byte & 0xFF);
}

std::uint32_t LoadCheck(CheckKind kind, std::span<const std::uint8_t> bytes) {
  const std::size_t count = CheckBytes(kind);
  Check(bytes.size() == count, "a check has the length of its kind");
  std::uint32_t check = 0;
  for (std::size_t i = 0; i < count; ++i) check = check << 8 | bytes[IsHighFirst(kind) ? i : count - 1 - i];
  return check;
}

BlindSpot BlindSpotOf(CheckKind kind) {
  switch (kind) {
    case CheckKind::kFletcher16:
      return {.bytes_count = 3, .ways_count = kFletcherModulus - 1};
    case CheckKind::kCrc16Ibm3740:
    case CheckKind::kCrc16IbmSdlc:
      return {.bytes_count = 3, .ways_count = 8};
    case CheckKind::kCrc32IsoHdlc:
      return {.bytes_count = 5, .ways_count = 8};
    case CheckKind::kSum8:
      return {.bytes_count = 2, .ways_count = 255};
    case CheckKind::kNone:
      return {.bytes_count = 1, .ways_count = 255};
  }
  ThrowBrokenInvariant("a kind of check");
}

std::string ChangeUnseen(CheckKind kind, std::span<std::uint8_t> bytes, std::uint32_t way) {
  const BlindSpot spot = BlindSpotOf(kind);
  Check(bytes.size() == spot.bytes_count && way < spot.ways_count, "a change in the check's blind spot");
  const std::uint32_t d = 1 + way;
  switch (kind) {
    case CheckKind::kFletcher16: {
      // Bytes that change by d, -2d and d modulo 255 change neither of Fletcher's sums.
      const std::array<std::uint32_t, 3> differences = {d, 2 * (kFletcherModulus - d), d};
      for (std::size_t i = 0; i < bytes.size(); ++i)
        bytes[i] = static_cast<std::uint8_t>((bytes[i] + differences[i]) % kFletcherModulus);
      return "by " + std::to_string(d) + ", -2 times that, and that again";
    }
    case CheckKind::kCrc16Ibm3740:
      ChangeByPolynomial(kIbm3740Polynomial, false, way, bytes);
      break;
    case CheckKind::kCrc16IbmSdlc:
      ChangeByPolynomial(kSdlcPolynomial, true, way, bytes);
      break;
    case CheckKind::kCrc32IsoHdlc:
      ChangeByPolynomial(kIsoHdlcPolynomial, true, way, bytes);
      break;
    case CheckKind::kSum8:
      bytes[0] = static_cast<std::uint8_t>(bytes[0] + d);
      bytes[1] = static_cast<std::uint8_t>(bytes[1] - d);
      return "by " + std::to_string(d) + " and back by the next byte";
    case CheckKind::kNone:
      bytes[0] = static_cast<std::uint8_t>(bytes[0] + d);
      return "by " + std::to_string(d);
  }
  return "by the polynomial times x^" + std::to_string(way);
}

}  // namespace tiltproof::link
