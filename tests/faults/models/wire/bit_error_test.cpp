#include <gtest/gtest.h>

#include <cmath>

#include "tests/faults/faulty_line.h"

namespace tiltproof::faults {
namespace {

TEST(BitErrorTest, HasItsRatioOnEveryBitAlike) {
  const double ber = 0.003;
  constexpr std::int64_t kCount = 20'000;
  const auto out = Send(Spec("wire.bit_error", {{"ber", ber}}), kCount);
  std::vector<double> by_bit(8 * 68, 0.0);
  double total = 0;
  double pairs = 0;
  for (std::int64_t n = 0; n < kCount; ++n) {
    const auto bits = FlippedBits(Frame(n), out[static_cast<std::size_t>(n)].at(0));
    for (std::size_t i = 0; i < bits.size(); ++i) {
      ++by_bit[bits[i]];
      ++total;
      if (i > 0 && bits[i] == bits[i - 1] + 1) ++pairs;
    }
  }
  const double bit_count = 544.0 * kCount;
  EXPECT_NEAR(total, bit_count * ber, 5 * std::sqrt(bit_count * ber));
  // Neighbours go wrong together no more often than chance has it.
  EXPECT_NEAR(pairs, 543.0 * kCount * ber * ber, 5 * std::sqrt(543.0 * kCount * ber * ber));
  const double expected = kCount * ber;
  for (const double count : by_bit) EXPECT_NEAR(count, expected, 6 * std::sqrt(expected));
}

TEST(BitErrorTest, RatioOneFlipsEverything) {
  const auto out = Send(Spec("wire.bit_error", {{"ber", 1.0}}), 1).at(0).at(0);
  EXPECT_EQ(FlippedBits(Frame(0), out).size(), 544U);
}

TEST(BitErrorTest, SaysWhichBits) {
  FaultSchedule schedule({Spec("wire.bit_error", {{"ber", 0.002}})}, 1);
  const auto out = Send(schedule, 200);
  int checked = 0;
  for (const Activation& activation : schedule.TakeActivations(kOriginAtPowerOn)) {
    const auto bits = FlippedBits(activation.before.at(0), activation.after.at(0));
    if (bits.size() != 2) continue;
    EXPECT_EQ(activation.what, "2 bits flipped: byte " + std::to_string(bits[0] / 8) + " bit " +
                                   std::to_string(bits[0] % 8) + ", byte " + std::to_string(bits[1] / 8) +
                                   " bit " + std::to_string(bits[1] % 8));
    ++checked;
  }
  EXPECT_GT(checked, 10);
}

}  // namespace
}  // namespace tiltproof::faults
