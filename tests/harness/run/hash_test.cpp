#include "harness/run/hash.h"

#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <random>

namespace tiltproof::harness {
namespace {

// The value that the authors publish for this text (draft-eastlake-fnv, appendix).
TEST(Fnv1a, HasThePublishedValue) {
  constexpr std::array<std::uint8_t, 6> kFoobar = {'f', 'o', 'o', 'b', 'a', 'r'};
  EXPECT_EQ(Fnv1a(kFoobar), 0x85944171f73967e8u);
}

TEST(Fnv1a, OfAWordIsThatOfItsBytes) {
  std::mt19937_64 random(1);
  for (int i = 0; i < 100'000; ++i) {
    // With any number of zero bytes at its end, all eight included.
    const std::uint64_t shift = random() % 72;
    const std::uint64_t word = shift < 64 ? random() << shift : 0;
    const std::uint64_t hash = random();
    EXPECT_EQ(Fnv1a(word, hash), Fnv1a(std::bit_cast<std::array<std::uint8_t, 8>>(word), hash));
  }
}

}  // namespace
}  // namespace tiltproof::harness
