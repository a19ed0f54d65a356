#include "harness/campaign/paired_rates.h"

#include <algorithm>
#include <cmath>

#include "harness/report/repeats.h"

namespace tiltproof::harness {
namespace {

// Probability of at most the smaller, or at least the larger, of two counts that are equally likely for each pair. The
// terms of the binomial are relative to the middle one, so that none overflows.
double ExactMcNemar(std::uint64_t first, std::uint64_t second) {
  const std::uint64_t count = first + second, smaller = std::min(first, second), middle = count / 2;
  double tail = 0.0, all = 0.0, term = 1.0;
  for (std::uint64_t k = middle + 1; k-- > 0;) {
    // C(n, k), and once more for C(n, n - k).
    const double both_sides = 2 * k == count ? term : 2 * term;
    all += both_sides;
    if (k <= smaller) tail += 2 * term;
    term *= static_cast<double>(k) / static_cast<double>(count - k + 1);
  }
  return std::min(1.0, tail / all);
}

}  // namespace

PairedDifference DifferenceOf(const PairedCounts& counts) {
  PairedDifference result;
  const std::uint64_t count = counts.count();
  if (count == 0) return result;
  const double n = static_cast<double>(count);
  const double a = static_cast<double>(counts.both), b = static_cast<double>(counts.only_second),
               c = static_cast<double>(counts.only_first), d = static_cast<double>(counts.neither);
  const double second = (a + b) / n, first = (a + c) / n;
  const auto [low_2, high_2] = WilsonInterval(counts.both + counts.only_second, count);
  const auto [low_1, high_1] = WilsonInterval(counts.both + counts.only_first, count);
  // Correlation of the two, with Newcombe's correction for continuity.
  double excess = a * d - b * c;
  if (excess > 0) excess = std::max(0.0, excess - n / 2);
  const double product = (a + b) * (c + d) * (a + c) * (b + d);
  const double phi = product > 0 ? excess / std::sqrt(product) : 0.0;
  const auto distance = [&](double x, double y) {
    return std::sqrt(std::max(0.0, x * x - 2 * phi * x * y + y * y));
  };
  result.difference = second - first;
  result.low = result.difference - distance(second - low_2, high_1 - first);
  result.high = result.difference + distance(high_2 - second, first - low_1);
  result.p = ExactMcNemar(counts.only_first, counts.only_second);
  return result;
}

}  // namespace tiltproof::harness
