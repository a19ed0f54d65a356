#include <gtest/gtest.h>

#include "tests/faults/faulty_line.h"
#include "tests/faults/goodness_of_fit.h"

namespace tiltproof::faults {
namespace {

TEST(BitErrorTest, HasItsRatioOnEveryBitAlike) {
  const double ber = 0.01;
  constexpr std::int64_t kCount = 20'000;
  const auto out = Send(Spec("wire.bit_error", {{"ber", ber}}), kCount);
  std::vector<double> by_bit(8 * 68, 0.0);
  std::vector<bool> flipped;
  for (std::int64_t n = 0; n < kCount; ++n) {
    flipped.resize(flipped.size() + by_bit.size());
    for (const std::size_t bit : FlippedBits(Frame(n), out[static_cast<std::size_t>(n)].at(0))) {
      ++by_bit[bit];
      flipped[flipped.size() - by_bit.size() + bit] = true;
    }
  }
  // Some 109 000 flips, in all frames as one sequence of bits.
  EXPECT_TRUE(AreBernoulli(flipped, ber));
  EXPECT_TRUE(AreUniform(by_bit));
}

TEST(BitErrorTest, RatioOneFlipsEverything) {
  const auto out = Send(Spec("wire.bit_error", {{"ber", 1.0}}), 1).at(0).at(0);
  EXPECT_EQ(FlippedBits(Frame(0), out).size(), 544U);
}

TEST(BitErrorTest, SaysWhichBits) {
  FaultSchedule schedule = AtTheLine({Spec("wire.bit_error", {{"ber", 0.002}})}, 1);
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
