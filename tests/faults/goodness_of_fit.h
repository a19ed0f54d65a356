// Judgements on whether draws have a distribution. Seeds in tests are fixed: a test passes always or fails always.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <vector>

namespace tiltproof::faults {

// The statistic of Kolmogorov and Smirnov: sqrt(n) times the greatest distance between the draws' distribution
// function and `cdf`. For many draws from that distribution it exceeds 1.95 in one case of 1000.
inline constexpr double kKolmogorovCritical = 1.95;
inline double KolmogorovStatistic(std::vector<double> draws, const std::function<double(double)>& cdf) {
  std::sort(draws.begin(), draws.end());
  const auto n = static_cast<double>(draws.size());
  double distance = 0;
  for (std::size_t i = 0; i < draws.size(); ++i) {
    const double expected = cdf(draws[i]);
    distance = std::max(
        {distance, static_cast<double>(i + 1) / n - expected, expected - static_cast<double>(i) / n});
  }
  return std::sqrt(n) * distance;
}

inline double NormalCdf(double x) { return 0.5 * std::erfc(-x / std::sqrt(2.0)); }

// Pearson's statistic. With k cells, and draws that have the expected distribution, it exceeds the quantiles of
// the chi-square distribution with k - 1 degrees of freedom as often as these say.
inline double ChiSquareStatistic(const std::vector<double>& observed, const std::vector<double>& expected) {
  double sum = 0;
  for (std::size_t i = 0; i < observed.size(); ++i) {
    const double difference = observed[i] - expected.at(i);
    sum += difference * difference / expected[i];
  }
  return sum;
}

// The value that the statistic exceeds in one case of 1000 (Wilson and Hilferty, The Distribution of Chi-Square, 1931;
// right to 3 % from one degree on).
inline double ChiSquareCritical(std::size_t degrees) {
  const double a = 2.0 / (9.0 * static_cast<double>(degrees));
  return static_cast<double>(degrees) * std::pow(1 - a + 3.0902 * std::sqrt(a), 3);
}

// The judgements below say what they found when they fail:
//
//   EXPECT_TRUE(AreUniform(counts));
inline ::testing::AssertionResult HaveCounts(const std::vector<double>& observed,
                                             const std::vector<double>& expected) {
  const double statistic = ChiSquareStatistic(observed, expected);
  const double critical = ChiSquareCritical(expected.size() - 1);
  if (statistic < critical) return ::testing::AssertionSuccess();
  return ::testing::AssertionFailure()
         << "chi-square " << statistic << " of " << expected.size() << " cells, critical " << critical;
}

// Counts of cells that are equally likely.
inline ::testing::AssertionResult AreUniform(const std::vector<double>& counts) {
  double total = 0;
  for (const double count : counts) total += count;
  return HaveCounts(counts, std::vector<double>(counts.size(), total / static_cast<double>(counts.size())));
}

inline ::testing::AssertionResult HaveCdf(const std::vector<double>& draws,
                                          const std::function<double(double)>& cdf) {
  const double statistic = KolmogorovStatistic(draws, cdf);
  if (statistic < kKolmogorovCritical) return ::testing::AssertionSuccess();
  return ::testing::AssertionFailure() << "Kolmogorov " << statistic << " of " << draws.size()
                                       << " draws, critical " << kKolmogorovCritical;
}

// Numbers of failures before a success: k with probability p (1 - p)^k. Cells are a tenth of the mean wide, or 1;
// the last one has all above, where no more than some twenty are expected.
inline ::testing::AssertionResult AreGeometric(const std::vector<double>& failures, double p) {
  const double width = std::max(1.0, std::floor(0.1 / p));
  const auto above = [&](std::size_t cell) {
    return static_cast<double>(failures.size()) * std::pow(1 - p, width * static_cast<double>(cell));
  };
  std::vector<double> expected;
  while (above(expected.size() + 1) > 20)
    expected.push_back(above(expected.size()) - above(expected.size() + 1));
  expected.push_back(above(expected.size()));
  std::vector<double> observed(expected.size());
  for (const double count : failures)
    ++observed[std::min(static_cast<std::size_t>(count / width), observed.size() - 1)];
  return HaveCounts(observed, expected);
}

// Events that happen on each occasion with probability p, independently of each other: how many occasions pass
// before each is geometric. A wrong share shows as well as one that depends on what happened before.
inline ::testing::AssertionResult AreBernoulli(const std::vector<bool>& happened, double p) {
  std::vector<double> failures;
  double since = 0;
  for (const bool event : happened) {
    if (event) failures.push_back(since);
    since = event ? 0 : since + 1;
  }
  return AreGeometric(failures, p);
}

// The correlation of neighbours. Of n independent draws with mean 0 it is beyond 4 / sqrt(n) in one case of
// 16 000.
inline double CorrelationOfNeighbours(const std::vector<double>& draws) {
  double squares = 0, products = 0;
  for (std::size_t i = 0; i < draws.size(); ++i) {
    squares += draws[i] * draws[i];
    if (i > 0) products += draws[i] * draws[i - 1];
  }
  return products / squares;
}

}  // namespace tiltproof::faults
