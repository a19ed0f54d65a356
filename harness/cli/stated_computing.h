// A firmware that states its computing time shows it only in flight. Faults on computing change nothing for any other.
//
//   if (const std::string why = WhyNoComputing(means, entry); !why.empty()) throw UsageError(why);
#pragma once

#include <string>

#include "harness/cli/suite.h"
#include "harness/engine/flight_job.h"

namespace tiltproof::harness {

// Flies the scenario. The reason that faults on computing change nothing there; empty: a firmware states its computing, or the
// flight could not show it.
std::string WhyNoComputing(const FlightMeans& means, const SuiteScenario& entry);

}  // namespace tiltproof::harness
