// The implicit criterion `clean_line`: what each client does while nothing is wrong with its line (docs/criteria.md).
#pragma once

#include <optional>

#include "harness/score/score.h"

namespace tiltproof::harness {

// Judges each client; the result is the first with the worst verdict. None when there is nothing to judge: the flight
// never began, this program or the user cut it short, or the log is that of an older program.
std::optional<CriterionResult> CleanLine(const Scenario& scenario, const RunLog& log);

}  // namespace tiltproof::harness
