// Summary of the flights of one scenario with many seeds: how many pass, and which was the worst.
//
//   const std::vector<FlightResult> results = ReadResults("results/latest");
//   for (const Repeats& repeats : RepeatsOf(results, {"hover", "hover"})) Print(stdout, "{}\n", repeats.scenario);
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "harness/report/results.h"

namespace tiltproof::harness {

// The share of successes in the long run, from `successes` of `count`: Wilson's score interval with 95 % confidence
// (E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209; Brown, Cai, DasGupta, Stat. Sci. 16 (2001) 101, section 3.1.1).
// Both ends in 0 to 1; count at least 1.
std::pair<double, double> WilsonInterval(std::size_t successes, std::size_t count);

struct Repeats {
  std::string scenario;
  std::size_t flown = 0, passed = 0;
  std::size_t errors = 0;     // among them: they say nothing of the firmware
  bool all_the_same = false;  // nothing was drawn at random: each seed gave the same flight
  // Worst of these results: fail before inconclusive before pass before error, then the least margin, then those
  // without a margin (a restart, for instance), the one that flew least first.
  const FlightResult* worst = nullptr;
  std::optional<double> margin;      // its least
  std::string criterion;             // that has it
  std::optional<double> survived_s;  // how long it flew; none: it did not
};

// `scenarios`: of each result, in the same order. Results without a flight (not flown) are to be left out. In the
// order in which scenarios first occur.
std::vector<Repeats> RepeatsOf(std::span<const FlightResult> results,
                               const std::vector<std::string>& scenarios);

}  // namespace tiltproof::harness
