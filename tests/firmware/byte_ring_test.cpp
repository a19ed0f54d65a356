#include "firmware/ports/stm32f4/byte_ring.h"

#include <gtest/gtest.h>

#include <cstring>
#include <deque>
#include <random>

namespace tiltproof::stm32f4 {
namespace {

constexpr std::uint32_t kBytes = 16;

// Against a queue without end, written and read in random pieces.
TEST(ByteRing, GivesBackWhatItTookInOrderAndRefusesWhatDoesNotFit) {
  ByteRing<kBytes> ring;
  std::deque<std::uint8_t> expected;
  std::mt19937 random(7);
  int refused_count = 0;
  for (int step = 0; step < 100'000; ++step) {
    if (random() % 4 != 0) {
      const auto byte = static_cast<std::uint8_t>(random());
      const bool fits = expected.size() < kBytes;
      EXPECT_EQ(ring.Room() > 0, fits);
      ASSERT_EQ(ring.Put(byte), fits);
      if (fits) expected.push_back(byte);
      refused_count += fits ? 0 : 1;
    } else {
      const auto front = ring.Front();
      ASSERT_LE(front.size(), expected.size());
      ASSERT_EQ(front.empty(), expected.empty());
      const std::size_t count = front.empty() ? 0 : random() % front.size() + 1;
      for (std::size_t i = 0; i < count; ++i) {
        ASSERT_EQ(front[i], expected.front());
        expected.pop_front();
      }
      ring.Drop(count);
    }
    ASSERT_EQ(ring.Count(), expected.size());
  }
  EXPECT_GT(refused_count, 100);
}

// A bit of an index flips: whatever is read lies in the ring, and soon it works again.
TEST(ByteRing, RecoversFromDamagedIndices) {
  for (unsigned index = 0; index < 2; ++index) {
    for (unsigned bit = 0; bit < 32; ++bit) {
      ByteRing<kBytes> ring;
      for (std::uint8_t byte = 0; byte < 5; ++byte) ring.Put(byte);
      ring.Drop(2);
      std::uint32_t value;
      auto* const place = reinterpret_cast<unsigned char*>(&ring) + 4 * index;
      std::memcpy(&value, place, 4);
      value ^= std::uint32_t{1} << bit;
      std::memcpy(place, &value, 4);

      const auto* const begin = reinterpret_cast<const std::uint8_t*>(&ring);
      std::size_t read_count = 0;
      for (auto front = ring.Front(); !front.empty(); front = ring.Front()) {
        ASSERT_GE(front.data(), begin);
        ASSERT_LE(front.data() + front.size(), begin + sizeof(ring));
        read_count += front.size();
        ASSERT_LE(read_count, kBytes);
        ring.Drop(front.size());
      }
      ASSERT_TRUE(ring.Put(42));
      ASSERT_EQ(ring.Front().size(), 1U);
      EXPECT_EQ(ring.Front().front(), 42);
    }
  }
}

}  // namespace
}  // namespace tiltproof::stm32f4
