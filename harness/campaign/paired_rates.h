// Two firmwares on the same draws: how much more often one passes. Pure.
//
//   const PairedCounts counts{.both = 36, .only_first = 12, .only_second = 2, .neither = 0};
//   const PairedDifference change = DifferenceOf(counts);  // -0.2, from -0.34 to -0.057; p = 0.013
#pragma once

#include <cstdint>

#include "link/fields.h"

namespace tiltproof::harness {

// Flights of the same draw by two firmwares, by which of them passed.
struct PairedCounts {
  std::uint64_t both = 0, only_first = 0, only_second = 0, neither = 0;
  std::uint64_t count() const { return both + only_first + only_second + neither; }
  TILTPROOF_FIELDS(both, only_first, only_second, neither)
};

struct PairedDifference {
  double difference = 0.0;        // share of passes of the second, less that of the first; -1 to 1
  double low = -1.0, high = 1.0;  // 95 % confidence
  double p = 1.0;                 // of at least such a difference when both are equally good
  TILTPROOF_FIELDS(difference, low, high, p)
};

// The interval is Newcombe's from two score intervals (R. G. Newcombe, Statistics in Medicine 17 (1998) 2635, method 10).
// p is McNemar's exact test, two-sided: binomial with 1/2 over the pairs that differ (Q. McNemar, Psychometrika 12 (1947)
// 153). Without a pair: the whole range, and p = 1.
PairedDifference DifferenceOf(const PairedCounts& counts);

}  // namespace tiltproof::harness
