#include <gtest/gtest.h>

#include <bit>
#include <vector>

#include "tests/faults/goodness_of_fit.h"
#include "tests/faults/one_signal.h"

namespace tiltproof::faults {
namespace {

FaultSpec Garbage(double probability) {
  return Spec("sensor.garbage", {{"signal", "z_m"}, {"probability", probability}});
}

TEST(GarbageTest, EachByteOfAReadingIsUniform) {
  constexpr std::int64_t kSamples = 100'000;
  const auto heights = ReadHeights(
      Garbage(1), kSamples, [](std::int64_t) { return 1.0F; }, 3);
  for (int shift = 0; shift < 32; shift += 8) {
    std::vector<double> observed(256);
    for (const float height : heights) ++observed[std::bit_cast<std::uint32_t>(height) >> shift & 0xFF];
    EXPECT_TRUE(AreUniform(observed)) << shift;
  }
}

TEST(GarbageTest, ReplacesWithItsProbability) {
  constexpr std::int64_t kSamples = 100'000;
  const auto heights = ReadHeights(Garbage(0.2), kSamples, [](std::int64_t) { return 1.0F; });
  std::vector<bool> replaced;
  for (const float height : heights) replaced.push_back(height != 1.0F);
  EXPECT_TRUE(AreBernoulli(replaced, 0.2));
}

}  // namespace
}  // namespace tiltproof::faults
