// The faults that make a flight fail: those without which it passes, or else the smallest sets of faults that suffice.
// Pure: it asks which faults fail alone, and flies nothing.
//
//   // Fault 0 breaks the flight, and so do 1 and 2 together.
//   const auto fails = [](const FaultSet& kept) { return kept.contains(0) || (kept.contains(1) && kept.contains(2)); };
//   const auto each = [&](const std::vector<FaultSet>& sets) {
//     std::vector<bool> answers;
//     for (const FaultSet& kept : sets) answers.push_back(fails(kept));
//     return answers;
//   };
//   const Causes causes = FindCauses({0, 1, 2}, each, 100);  // needed: none; sets: {0}, {1, 2}
//
// The sets are those of diagnosis by hitting sets (Reiter, A Theory of Diagnosis from First Principles, Artificial
// Intelligence 32, 1987): as long as removing one fault of each known set leaves a flight that fails, there is another set.
#pragma once

#include <cstddef>
#include <functional>
#include <set>
#include <vector>

namespace tiltproof::harness {

// Faults by their places in the scenario.
using FaultSet = std::set<std::size_t>;

struct Causes {
  std::vector<std::size_t> needed;  // ascending
  std::vector<FaultSet> sets;       // only when none is needed; empty set: it fails without any fault
  bool complete = true;             // false: the tests ran out, and there may be further sets
  std::size_t tests_count = 0;
};

// `fails_with`: for each set, whether the flight fails when only these faults remain; fewer answers: it is interrupted,
// and so is the search. The flight with `all` is known to fail. No more than `tests_max` sets are tested.
Causes FindCauses(const FaultSet& all,
                  const std::function<std::vector<bool>(const std::vector<FaultSet>&)>& fails_with,
                  std::size_t tests_max);

}  // namespace tiltproof::harness
