#include "link/fletcher16.h"

#include <gtest/gtest.h>

#include <rapidcheck/gtest.h>

#include <string_view>
#include <vector>

#include "tests/support/slow_codec.h"

namespace tiltproof::link {
namespace {

using tiltproof::testing::Bytes;

std::uint16_t OfText(std::string_view text) { return Fletcher16(Bytes(text.begin(), text.end())); }

std::uint16_t Slow(const Bytes& bytes) {
  const Bytes check = tiltproof::testing::SlowCheck(bytes);
  return static_cast<std::uint16_t>(check[1] << 8 | check[0]);
}

// The values commonly given for this checksum.
TEST(Fletcher16, KnownValues) {
  EXPECT_EQ(OfText("abcde"), 0xC8F0);
  EXPECT_EQ(OfText("abcdef"), 0x2057);
  EXPECT_EQ(OfText("abcdefgh"), 0x0627);
}

TEST(Fletcher16, OfNothingIsZero) { EXPECT_EQ(Fletcher16({}), 0); }

// The weakness that the checks of messages are there for.
TEST(Fletcher16, CannotTellZeroFromFF) {
  EXPECT_EQ(Fletcher16(Bytes{1, 0x00, 2}), Fletcher16(Bytes{1, 0xFF, 2}));
  EXPECT_NE(Fletcher16(Bytes{1, 0x00, 2}), Fletcher16(Bytes{1, 0xFE, 2}));
}

// The largest sums, on both sides of every length at which the sums are reduced.
TEST(Fletcher16, DoesNotOverflow) {
  for (const std::size_t block_count : {1u, 2u, 3u}) {
    for (std::size_t length = 5802 * block_count - 2; length <= 5802 * block_count + 2; ++length) {
      for (const int value : {0xFF, 0xFE}) {
        const Bytes bytes(length, static_cast<std::uint8_t>(value));
        ASSERT_EQ(Fletcher16(bytes), Slow(bytes)) << length << " bytes of " << value;
      }
    }
  }
}

RC_GTEST_PROP(Fletcher16, AgreesWithADivisionAByte, (const Bytes& bytes)) {
  RC_ASSERT(Fletcher16(bytes) == Slow(bytes));
}

}  // namespace
}  // namespace tiltproof::link
