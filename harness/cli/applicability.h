// Which scenarios can be flown with the chosen client, in the chosen mode: not every client can have every fault,
// and not every image has the memory that a fault flips.
#pragma once

#include <vector>

#include "harness/cli/suite.h"
#include "harness/engine/flight_job.h"
#include "harness/report/results.h"

namespace tiltproof::harness {

// Takes what cannot be flown out of the suite and returns it with its reasons. What the user named himself is
// asked for and cannot be had: UsageError with every reason, and with `strict` also for what was found in a folder.
// Throws UsageError, too, when the emulator has no image for a scenario.
std::vector<NotApplicable> TakeNotApplicable(const FlightMeans& means, bool strict, Suite& suite);

}  // namespace tiltproof::harness
