// The binomial distribution, for large numbers of trials: with the same bits on every processor, because it needs no
// other functions than exp, log and log1p.
#pragma once

#include <cstdint>
#include <span>
#include <utility>

namespace tiltproof::harness {

// The probability of `successes` of `trials`, each with the probability p in (0, 1).
double BinomialProbability(std::int64_t trials, std::int64_t successes, double p);
// The probability of more successes than that.
double BinomialTail(std::int64_t trials, std::int64_t successes, double p);

// The bounds between which the probability of a success lies, but for `error_probability`, half of it on either side
// (Clopper and Pearson, Biometrika 26 (1934) 404).
std::pair<double, double> ClopperPearson(std::int64_t successes, std::int64_t trials,
                                         double error_probability);

// Trials that have something in common, such as the frame that was damaged.
struct Cluster {
  std::int64_t trials = 0, successes = 0;
};
// The variance of the share of successes over that of independent trials; at least 1, because a few clusters may by
// chance differ too little. The trials of all clusters together are at least 1.
double DesignEffect(std::span<const Cluster> clusters);
// Bounds of Clopper and Pearson with the trials divided by the design effect (Korn and Graubard, Survey Methodology
// 24(2), 1998, 193).
std::pair<double, double> ClusteredBounds(std::span<const Cluster> clusters, double error_probability);

}  // namespace tiltproof::harness
