// The margin by which a flight is known: the least one of the criteria that its faults can have changed.
//
//   const Score score = ScoreRun(scenario, log);
//   if (const CriterionResult* least = HeadlineCriterion(score)) Print(stdout, "{}\n", least->name);
#pragma once

#include <optional>

#include "harness/formula/formula.h"
#include "harness/score/score.h"
#include "link/time.h"

namespace tiltproof::harness {

// False when the row that decided lies before `onset_ns`, the start of the first fault, or when the formula reads only what
// follows from the scenario alone: the time, the reference, and which faults are active. None without an onset.
std::optional<bool> FaultCanAffect(const stl::Formula& formula, std::optional<TimeNs> decided_ns,
                                   std::optional<TimeNs> onset_ns);

// The criterion with the smallest margin, of those that a fault can have changed or that failed. Null when none has a margin,
// and for a flight that failed without a margin below 0: it broke in another way.
const CriterionResult* HeadlineCriterion(const Score& score);

// The margin of that criterion.
std::optional<double> LeastMargin(const Score& score);

// The first violated criterion of a flight that failed; one without a time comes last. Null when none was violated.
const CriterionResult* FirstViolated(const Score& score);
// True if nothing is wrong with the flight: it passed, or its faults were too mild to act.
bool Survived(const Score& score);

}  // namespace tiltproof::harness
