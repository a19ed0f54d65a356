// The checks against published Hamming distances, by exact search at the lengths at which they change.
#include <gtest/gtest.h>

#include <cstdint>
#include <span>
#include <unordered_set>
#include <vector>

#include "link/checksum.h"

namespace tiltproof::link {
namespace {

bool SendsHighestBitFirst(CheckKind kind) { return kind == CheckKind::kCrc16Ibm3740; }

// The effect of one wrong bit on check against payload, by the bit's distance from the last one of the check. Bits count
// in the order in which the CRC divides them. `bits`: of payload and check.
std::vector<std::uint32_t> Syndromes(CheckKind kind, std::size_t bits) {
  const std::size_t check_bytes = CheckBytes(kind);
  std::vector<std::uint32_t> syndromes(bits);
  for (std::size_t i = 0; i < bits; ++i) {
    const std::size_t from_end = i / 8;
    const auto flipped = static_cast<std::uint8_t>(1 << (SendsHighestBitFirst(kind) ? i % 8 : 7 - i % 8));
    if (from_end < check_bytes) {
      std::vector<std::uint8_t> check(check_bytes);
      check[check_bytes - 1 - from_end] = flipped;
      syndromes[i] = LoadCheck(kind, check);
      continue;
    }
    // The bytes before the wrong one do not matter: without them the message is short.
    std::vector<std::uint8_t> payload(from_end - check_bytes + 1);
    const std::uint32_t intact = Checksum(kind, payload);
    payload[0] = flipped;
    syndromes[i] = Checksum(kind, payload) ^ intact;
  }
  return syndromes;
}

// Calls `visit` with the sum of each set of `count` syndromes from `first` on.
template <typename Visit>
void ForEachSum(std::span<const std::uint32_t> syndromes, int count, std::size_t first, std::uint32_t sum,
                const Visit& visit) {
  if (count == 0) return visit(sum);
  for (std::size_t i = first; i < syndromes.size(); ++i)
    ForEachSum(syndromes, count - 1, i + 1, sum ^ syndromes[i], visit);
}

// True when the least number of wrong bits that pass is at most `weight`. A pattern that passes does so at every place:
// one of them has the last bit. The other bits are met in the middle.
bool Passes(std::span<const std::uint32_t> syndromes, int weight) {
  for (int each = 2; each <= weight; ++each) {
    const int few = (each - 1) / 2;
    std::unordered_set<std::uint32_t> sums;
    ForEachSum(syndromes, few, 1, 0, [&](std::uint32_t sum) { sums.insert(sum); });
    bool found = false;
    ForEachSum(syndromes, each - 1 - few, 1, syndromes[0],
               [&](std::uint32_t sum) { found = found || sums.contains(sum); });
    if (found) return true;
  }
  return false;
}

struct PublishedLength {
  int distance;
  std::size_t data_bits_max;
};

// The lengths that Koopman publishes (users.ece.cmu.edu/~koopman/crc, polynomials 0x8810 and 0x82608EDB in his
// notation, and the output of his program hdlen). The distance of CRC-32 up to 4,294,967,263 bits, 3, is too long here.
void ExpectPublished(CheckKind kind, std::span<const PublishedLength> published) {
  const std::size_t check_bits = 8 * CheckBytes(kind);
  const std::vector<std::uint32_t> all = Syndromes(kind, published[0].data_bits_max + 1 + check_bits);
  for (const auto& [distance, data_bits_max] : published) {
    const std::span<const std::uint32_t> longest(all.data(), data_bits_max + check_bits);
    const std::span<const std::uint32_t> too_long(all.data(), data_bits_max + check_bits + 1);
    EXPECT_FALSE(Passes(longest, distance - 1)) << Name(kind) << " " << data_bits_max;
    EXPECT_TRUE(Passes(too_long, distance - 1)) << Name(kind) << " " << data_bits_max;
  }
}

TEST(PublishedDistances, BothCrc16HaveFourUpTo32751Bits) {
  // Every pattern that passes has an even number of bits, so that 3 and 4 have the same length: two bits pass beyond.
  constexpr PublishedLength kPublished[] = {{4, 32'751}, {3, 32'751}};
  ExpectPublished(CheckKind::kCrc16Ibm3740, kPublished);
  ExpectPublished(CheckKind::kCrc16IbmSdlc, kPublished);
}

TEST(PublishedDistances, Crc32HasItsLengths) {
  constexpr PublishedLength kPublished[] = {{4, 91'607}, {5, 2974}, {6, 268}, {7, 171}, {8, 91}, {9, 57}};
  ExpectPublished(CheckKind::kCrc32IsoHdlc, kPublished);
}

// The four bits of 3007 that Koopman's program prints for CRC-32: 0, 2215 and 2866, and the last one. It counts from the
// end that is sent last, and a code that is read backwards has the same distances.
TEST(PublishedDistances, Crc32MissesThePublishedPattern) {
  const std::vector<std::uint32_t> syndromes = Syndromes(CheckKind::kCrc32IsoHdlc, 2975 + 32);
  EXPECT_EQ(syndromes[0] ^ syndromes[2215] ^ syndromes[2866] ^ syndromes[3006], 0U);
}

}  // namespace
}  // namespace tiltproof::link
