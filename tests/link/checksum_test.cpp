// The checks of frames against the catalogue's values, against a slow reference that divides bit by bit, and against
// their own blind spots.

#include "link/checksum.h"

#include <gtest/gtest.h>

#include <random>
#include <string_view>
#include <vector>

namespace tiltproof::link {
namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes Text(std::string_view text) { return {text.begin(), text.end()}; }

// The algorithm of the RevEng catalogue, bit by bit.
struct CrcModel {
  unsigned width;
  std::uint64_t polynomial, init;
  bool is_reflected;
  std::uint64_t xor_out;

  std::uint32_t Of(const Bytes& bytes) const {
    std::uint64_t crc = init;
    const std::uint64_t top = std::uint64_t{1} << (width - 1), mask = (top << 1) - 1;
    for (const std::uint8_t byte : bytes) {
      for (unsigned i = 0; i < 8; ++i) {
        const bool bit = (byte >> (is_reflected ? i : 7 - i) & 1) != 0;
        const bool carry = ((crc & top) != 0) != bit;
        crc = crc << 1 & mask;
        if (carry) crc ^= polynomial;
      }
    }
    if (is_reflected) {
      std::uint64_t reversed = 0;
      for (unsigned i = 0; i < width; ++i) reversed |= (crc >> i & 1) << (width - 1 - i);
      crc = reversed;
    }
    return static_cast<std::uint32_t>(crc ^ xor_out);
  }
};

struct Entry {
  CheckKind kind;
  std::string_view name;
  std::uint32_t check;  // of "123456789", as the catalogue has it
  CrcModel model;
};
// https://reveng.sourceforge.io/crc-catalogue/
const Entry kCrcs[] = {
    {CheckKind::kCrc16Ibm3740, "crc16_ibm_3740", 0x29B1, {16, 0x1021, 0xFFFF, false, 0}},
    {CheckKind::kCrc16IbmSdlc, "crc16_ibm_sdlc", 0x906E, {16, 0x1021, 0xFFFF, true, 0xFFFF}},
    {CheckKind::kCrc32IsoHdlc, "crc32_iso_hdlc", 0xCBF43926, {32, 0x04C11DB7, 0xFFFFFFFF, true, 0xFFFFFFFF}},
};

TEST(Checksum, EqualsTheCatalogueAndASlowReference) {
  std::mt19937 generator(3);
  for (const Entry& entry : kCrcs) {
    EXPECT_EQ(Name(entry.kind), entry.name);
    EXPECT_EQ(Checksum(entry.kind, Text("123456789")), entry.check) << entry.name;
    for (std::size_t size = 0; size < 200; ++size) {
      Bytes bytes(size);
      for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(generator());
      ASSERT_EQ(Checksum(entry.kind, bytes), entry.model.Of(bytes)) << entry.name << " of " << size;
    }
  }
  EXPECT_EQ(Checksum(CheckKind::kFletcher16, Text("abcde")), 0xC8F0U);
  EXPECT_EQ(Checksum(CheckKind::kSum8, Bytes{0xFF, 0x03}), 0x02U);
  EXPECT_EQ(Checksum(CheckKind::kNone, Bytes{1, 2, 3}), 0U);
}

// Check and data divided together leave a constant, when the bits travel in the order of the division: the property by
// which a receiver in hardware judges a frame (RFC 1662, appendix C: "good final FCS").
TEST(Checksum, ACrcBehindItsDataLeavesTheConstantOfTheCatalogue) {
  const auto residue = [](CheckKind kind) {
    Bytes bytes = Text("tiltproof");
    const std::uint32_t check = Checksum(kind, bytes);
    const std::size_t count = CheckBytes(kind);
    for (std::size_t i = 0; i < count; ++i) bytes.push_back(CheckByte(kind, check, i));
    return Checksum(kind, bytes);
  };
  EXPECT_EQ(residue(CheckKind::kCrc16Ibm3740), 0x0000U);
  EXPECT_EQ(residue(CheckKind::kCrc16IbmSdlc) ^ 0xFFFFU, 0xF0B8U);
  EXPECT_EQ(residue(CheckKind::kCrc32IsoHdlc) ^ 0xFFFFFFFFU, 0xDEBB20E3U);
}

TEST(Checksum, ACheckIsReadAsItIsSent) {
  for (int i = 0; i <= static_cast<int>(LastOf(CheckKind())); ++i) {
    const auto kind = static_cast<CheckKind>(i);
    const std::uint32_t check = Checksum(kind, Text("123456789"));
    Bytes sent;
    for (std::size_t at = 0; at < CheckBytes(kind); ++at) sent.push_back(CheckByte(kind, check, at));
    EXPECT_EQ(LoadCheck(kind, sent), check) << Name(kind);
  }
}

TEST(Checksum, NoCheckSeesItsBlindSpot) {
  std::mt19937 generator(5);
  for (int i = 0; i <= static_cast<int>(LastOf(CheckKind())); ++i) {
    const auto kind = static_cast<CheckKind>(i);
    const BlindSpot spot = BlindSpotOf(kind);
    for (std::uint32_t way = 0; way < spot.ways_count; ++way) {
      Bytes bytes(64);
      for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(generator());
      const Bytes before = bytes;
      const std::size_t at = generator() % (bytes.size() - spot.bytes_count + 1);
      EXPECT_FALSE(ChangeUnseen(kind, std::span(bytes).subspan(at, spot.bytes_count), way).empty());
      ASSERT_NE(bytes, before) << Name(kind) << " way " << way;
      ASSERT_EQ(Checksum(kind, bytes), Checksum(kind, before)) << Name(kind) << " way " << way;
    }
  }
}

// Every burst that is not longer than the check is detected by a CRC (Peterson and Brown, 1961).
TEST(Checksum, ACrcDetectsEveryBurstOfItsLength) {
  const Bytes payload = Text("sixteen sensors.");
  for (const CheckKind kind : {CheckKind::kCrc16Ibm3740, CheckKind::kCrc16IbmSdlc}) {
    Bytes frame = payload;
    const std::uint32_t check = Checksum(kind, payload);
    for (std::size_t i = 0; i < 2; ++i) frame.push_back(CheckByte(kind, check, i));
    // The bits in the order in which they travel on a serial line, the lowest of each byte first, for the one that is
    // divided so; the highest first for the other.
    const bool low_first = kind == CheckKind::kCrc16IbmSdlc;
    for (std::size_t first = 0; first + 16 <= 8 * frame.size(); ++first) {
      for (std::uint32_t pattern = 1; pattern < 0x10000;
           pattern += 2 * (7 + static_cast<std::uint32_t>(first % 7))) {
        Bytes damaged = frame;
        for (std::size_t bit = 0; bit < 16; ++bit) {
          const std::size_t at = first + bit;
          if ((pattern >> bit & 1) != 0)
            damaged[at / 8] ^= static_cast<std::uint8_t>(1 << (low_first ? at % 8 : 7 - at % 8));
        }
        const auto content = std::span(damaged).first(payload.size());
        ASSERT_NE(Checksum(kind, content), LoadCheck(kind, std::span(damaged).last(2)));
      }
    }
  }
}

}  // namespace
}  // namespace tiltproof::link
