#include "harness/integrity/binomial.h"

#include <algorithm>
#include <cmath>

namespace tiltproof::harness {
namespace {

constexpr double kNegligible = 1e-17;

// log n!, by Stirling's series; its error is below 1e-15 here.
double LogFactorial(double n) {
  constexpr double kHalfLogTwoPi = 0.91893853320467274178;
  return (n + 0.5) * std::log(n) - n + kHalfLogTwoPi + 1 / (12 * n) - 1 / (360 * n * n * n);
}

double LogChoose(std::int64_t n, std::int64_t k) {
  constexpr std::int64_t kSummedMax = 10'000;
  if (std::min(k, n - k) > kSummedMax) {
    const auto all = static_cast<double>(n), chosen = static_cast<double>(k);
    return LogFactorial(all) - LogFactorial(chosen) - LogFactorial(all - chosen);
  }
  double sum = 0;
  for (std::int64_t i = 1; i <= std::min(k, n - k); ++i)
    sum += std::log(static_cast<double>(n - std::min(k, n - k) + i) / static_cast<double>(i));
  return sum;
}

double Probability(double log_choose, std::int64_t n, std::int64_t k, double p) {
  return std::exp(log_choose + static_cast<double>(k) * std::log(p) +
                  static_cast<double>(n - k) * std::log1p(-p));
}

// The probability of k and more, of which that of k is `first`; by the ratio of neighbours.
double Upwards(double first, std::int64_t n, std::int64_t k, double p) {
  double sum = first, term = first;
  for (std::int64_t i = k; i < n && term > kNegligible * sum; ++i) {
    term *= static_cast<double>(n - i) / static_cast<double>(i + 1) * p / (1 - p);
    sum += term;
  }
  return sum;
}

// The same of k and fewer.
double Downwards(double first, std::int64_t n, std::int64_t k, double p) {
  double sum = first, term = first;
  for (std::int64_t i = k; i > 0 && term > kNegligible * sum; --i) {
    term *= static_cast<double>(i) / static_cast<double>(n - i + 1) * (1 - p) / p;
    sum += term;
  }
  return sum;
}

// The p between the two at which a function that rises (or falls) with p has the value.
template <class Function>
double Find(double low, double high, bool rises, double value, const Function& function) {
  constexpr int kHalvings = 100;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = (low + high) / 2;
    ((function(middle) < value) == rises ? low : high) = middle;
  }
  return (low + high) / 2;
}

}  // namespace

double BinomialProbability(std::int64_t trials, std::int64_t successes, double p) {
  return Probability(LogChoose(trials, successes), trials, successes, p);
}

double BinomialTail(std::int64_t trials, std::int64_t successes, double p) {
  if (successes >= trials) return 0;
  return Upwards(BinomialProbability(trials, successes + 1, p), trials, successes + 1, p);
}

std::pair<double, double> ClopperPearson(std::int64_t successes, std::int64_t trials,
                                         double error_probability) {
  const double side = error_probability / 2,
               share = static_cast<double>(successes) / static_cast<double>(trials);
  const double log_choose = LogChoose(trials, successes);
  double low = 0, high = 1;
  if (successes > 0)
    low = Find(0, share, true, side, [&](double p) {
      return Upwards(Probability(log_choose, trials, successes, p), trials, successes, p);
    });
  if (successes < trials)
    high = Find(share, 1, false, side, [&](double p) {
      return Downwards(Probability(log_choose, trials, successes, p), trials, successes, p);
    });
  return {low, high};
}

double DesignEffect(std::span<const Cluster> clusters) {
  double trials = 0, successes = 0;
  for (const Cluster& cluster : clusters) {
    trials += static_cast<double>(cluster.trials);
    successes += static_cast<double>(cluster.successes);
  }
  const double share = successes / trials, binomial = trials * share * (1 - share);
  if (clusters.size() < 2 || !(binomial > 0)) return 1;
  double squares = 0;
  for (const Cluster& cluster : clusters) {
    const double distance =
        static_cast<double>(cluster.successes) - share * static_cast<double>(cluster.trials);
    squares += distance * distance;
  }
  const auto count = static_cast<double>(clusters.size());
  return std::max(1.0, count / (count - 1) * squares / binomial);
}

std::pair<double, double> ClusteredBounds(std::span<const Cluster> clusters, double error_probability) {
  std::int64_t trials = 0, successes = 0;
  for (const Cluster& cluster : clusters) {
    trials += cluster.trials;
    successes += cluster.successes;
  }
  const double effect = DesignEffect(clusters);
  const auto effective = std::max<std::int64_t>(std::llround(static_cast<double>(trials) / effect), 1);
  const double share = static_cast<double>(successes) / static_cast<double>(trials),
               expected = share * static_cast<double>(effective);
  const auto fewer = std::min(static_cast<std::int64_t>(std::floor(expected)), effective);
  const auto more = std::min(static_cast<std::int64_t>(std::ceil(expected)), effective);
  return {ClopperPearson(fewer, effective, error_probability).first,
          ClopperPearson(more, effective, error_probability).second};
}

}  // namespace tiltproof::harness
