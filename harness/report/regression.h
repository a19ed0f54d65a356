// Finds results that got worse since a baseline: the gate of a continuous integration. Only results count, so
// flights need no traces, and may differ where their scenarios or their firmware differ.
//
//   const Regression regression = CompareResults(ReadResults("baseline"), ReadResults("results/latest"), 1e-3);
//   if (regression.worse()) Print(stdout, "{} flights are worse\n", regression.worse_count());
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "harness/report/results.h"

namespace tiltproof::harness {

// A criterion before, and after; none: it is not judged there.
struct CriterionChange {
  std::string name;
  std::optional<Verdict> verdict_before, verdict_after;
  std::optional<double> margin_before, margin_after;  // none: it has none
  bool worse = false;   // not judged any more, a worse verdict, or less margin by more than the tolerance
  bool better = false;  // a better verdict, or more margin by more than the tolerance
};

struct FlightChange {
  std::string name;
  Verdict before{}, after{};
  std::vector<CriterionChange> criteria;  // in the baseline's order, then the new ones

  // Verdicts in their order of precedence: pass, inconclusive, fail, error.
  bool worse() const;
  bool better() const;  // and not worse
};

struct Regression {
  std::vector<FlightChange> flights;        // that both have, in the baseline's order
  std::vector<std::string> missing, added;  // flights that only the baseline has; that only the new run has

  std::size_t worse_count() const;
  std::size_t better_count() const;
  // A flight that is not flown any more counts: a gate that it leaves would be passed by not flying.
  bool worse() const { return worse_count() > 0 || !missing.empty(); }
};

// Pairs flights by name. `tolerance`: the fall of a margin that is still the same.
Regression CompareResults(const std::vector<FlightResult>& baseline, const std::vector<FlightResult>& now,
                          double tolerance);

}  // namespace tiltproof::harness
