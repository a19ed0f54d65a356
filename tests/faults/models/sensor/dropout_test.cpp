#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "tests/faults/goodness_of_fit.h"
#include "tests/faults/one_signal.h"

namespace tiltproof::faults {
namespace {

FaultSpec Dropout(double probability, const std::string& reads) {
  return Spec("sensor.dropout", {{"signal", "z_m"}, {"probability", probability}, {"reads", reads}});
}

float MovingHeight(std::int64_t n) { return 1.0F + 0.5F * static_cast<float>(n); }

// Lengths of runs of lost samples, 1, 2, ..., are geometrically distributed.
TEST(DropoutTest, LosesEachSampleIndependently) {
  constexpr std::size_t kSamples = 200'000;
  constexpr double kProbability = 0.3;
  const auto heights = ReadHeights(Dropout(kProbability, "nan"), kSamples, MovingHeight, 2);
  constexpr std::size_t kLongest = 6;  // the last cell has all longer ones
  std::vector<double> observed(kLongest), expected(kLongest);
  std::size_t run = 0;
  double runs = 0;
  for (const float height : heights) {
    if (std::isnan(height)) {
      ++run;
    } else if (run > 0) {
      ++observed[std::min(run, kLongest) - 1];
      ++runs;
      run = 0;
    }
  }
  for (std::size_t i = 0; i < kLongest; ++i)
    expected[i] = runs * std::pow(kProbability, i) * (i + 1 == kLongest ? 1 : 1 - kProbability);
  EXPECT_LT(ChiSquareStatistic(observed, expected), 20.52);  // 5 degrees of freedom, 0.999
  const double lost = static_cast<double>(
      std::count_if(heights.begin(), heights.end(), [](float height) { return std::isnan(height); }));
  EXPECT_NEAR(lost / kSamples, kProbability,
              4 * std::sqrt(kProbability * (1 - kProbability) / static_cast<double>(kSamples)));
}

// The same seed loses the same samples, whatever is read.
TEST(DropoutTest, ALostSampleReadsTheLastOneOrZero) {
  const auto lost = ReadHeights(Dropout(0.5, "nan"), 200, MovingHeight);
  const auto zero = ReadHeights(Dropout(0.5, "zero"), 200, MovingHeight);
  const auto last = ReadHeights(Dropout(0.5, "last"), 200, MovingHeight);
  for (std::size_t n = 0; n < lost.size(); ++n) {
    const float truth = MovingHeight(static_cast<std::int64_t>(n));
    EXPECT_EQ(zero[n], std::isnan(lost[n]) ? 0.0F : truth) << n;
    EXPECT_EQ(last[n], !std::isnan(lost[n]) ? truth : n == 0 ? 0.0F : last[n - 1]) << n;
  }
}

TEST(DropoutTest, TheLastValueMayBeOfBeforeTheWindow) {
  const auto heights = ReadHeights(At(Dropout(1, "last"), 3 * kPeriod, 5 * kPeriod), 6, MovingHeight);
  EXPECT_THAT(heights, ::testing::ElementsAre(1.0F, 1.5F, 2.0F, 2.0F, 2.0F, 3.5F));
  EXPECT_EQ(ReadHeights(Dropout(1, "last"), 1, MovingHeight).front(), 0);
}

}  // namespace
}  // namespace tiltproof::faults
