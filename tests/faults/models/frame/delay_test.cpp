#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/faults/faulty_line.h"
#include "tests/faults/goodness_of_fit.h"

namespace tiltproof::faults {
namespace {

std::vector<double> DelaysMs(const std::string& distribution, double mean_ms, double jitter_ms,
                             std::int64_t count) {
  const auto out = Send(
      Spec("frame.delay", {{"mean_ms", mean_ms}, {"jitter_ms", jitter_ms}, {"distribution", distribution}}),
      count, 8);
  std::vector<double> delays;
  for (std::size_t n = 0; n < out.size(); ++n) {
    const link::Chunk frame = Frame(static_cast<std::int64_t>(n), 8);
    EXPECT_EQ(out[n].at(0).bytes, frame.bytes);
    delays.push_back(static_cast<double>(out[n].at(0).begin_ns - frame.begin_ns) * 1e-6);
  }
  return delays;
}

double Mean(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

bool AreUncorrelated(std::vector<double> delays, double mean_ms) {
  for (double& delay : delays) delay -= mean_ms;
  return std::abs(CorrelationOfNeighbours(delays)) < 4 / std::sqrt(static_cast<double>(delays.size()));
}

double Min(const std::vector<double>& values) { return *std::min_element(values.begin(), values.end()); }
double Max(const std::vector<double>& values) { return *std::max_element(values.begin(), values.end()); }

TEST(DelayTest, ConstantIsExactWhateverTheJitter) {
  for (const double delay : DelaysMs("constant", 2.5, 1.0, 100)) EXPECT_EQ(delay, 2.5);
}

TEST(DelayTest, ConstantIsTheDefault) {
  const auto out = Send(Spec("frame.delay", {{"mean_ms", 5.0}}), 1);
  EXPECT_EQ(out.at(0).at(0).begin_ns, BootTime(5 * kNsPerMs));
}

TEST(DelayTest, UniformStaysWithinItsJitter) {
  const auto delays = DelaysMs("uniform", 5.0, 2.0, 100'000);
  EXPECT_GE(Min(delays), 3.0);
  EXPECT_LT(Max(delays), 7.0);
  EXPECT_LT(Min(delays), 3.01);
  EXPECT_GT(Max(delays), 6.99);
  EXPECT_TRUE(HaveCdf(delays, [](double delay) { return (delay - 3.0) / 4.0; }));
  EXPECT_TRUE(AreUncorrelated(delays, 5.0));
}

TEST(DelayTest, NormalHasItsMeanAndDeviation) {
  const auto delays = DelaysMs("normal", 10.0, 2.0, 100'000);
  EXPECT_TRUE(HaveCdf(delays, [](double delay) { return NormalCdf((delay - 10.0) / 2.0); }));
  EXPECT_TRUE(AreUncorrelated(delays, 10.0));
}

TEST(DelayTest, NegativeDrawsClipToZero) {
  auto delays = DelaysMs("normal", 0.0, 1.0, 200'000);
  EXPECT_EQ(Min(delays), 0.0);
  std::vector<bool> zero;
  for (const double delay : delays) zero.push_back(delay == 0.0);
  EXPECT_TRUE(AreBernoulli(zero, 0.5));
  // Those above 0 are half of the distribution.
  std::erase(delays, 0.0);
  EXPECT_TRUE(HaveCdf(delays, [](double delay) { return 2 * NormalCdf(delay) - 1; }));
}

TEST(DelayTest, ParetoHasItsMeanItsLeastValueAndItsTail) {
  // Mean 4 and deviation 4/sqrt(3): shape 1 + sqrt(1 + 3) = 3, least 8/3.
  const auto delays = DelaysMs("pareto", 4.0, 4.0 / std::sqrt(3.0), 100'000);
  EXPECT_TRUE(HaveCdf(delays, [](double delay) { return 1 - std::pow(8.0 / 3 / delay, 3); }));
  EXPECT_NEAR(Mean(delays), 4.0, 0.05);
  EXPECT_GE(Min(delays), 8.0 / 3 - 1e-6);
  EXPECT_LT(Min(delays), 8.0 / 3 + 0.01);
  for (const double bound : {4.0, 8.0, 16.0}) {
    const double expected = 1e5 * std::pow(8.0 / 3 / bound, 3);
    const auto beyond =
        std::count_if(delays.begin(), delays.end(), [bound](double delay) { return delay > bound; });
    EXPECT_NEAR(static_cast<double>(beyond), expected, 5 * std::sqrt(expected)) << bound;
  }
}

TEST(DelayTest, ParetoWithoutJitterIsConstant) {
  for (const double delay : DelaysMs("pareto", 3.0, 0.0, 10)) EXPECT_EQ(delay, 3.0);
  for (const double delay : DelaysMs("pareto", 0.0, 3.0, 10)) EXPECT_EQ(delay, 0.0);
}

}  // namespace
}  // namespace tiltproof::faults
