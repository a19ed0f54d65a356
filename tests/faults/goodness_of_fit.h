// Whether draws have a distribution. Seeds in tests are fixed, so that a test passes or fails always.
#pragma once

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
