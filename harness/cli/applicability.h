// Selects the scenarios that can be flown with the chosen client, in the chosen mode. Not every fault is possible with
// every client, and not every image has the memory that a fault flips.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "harness/campaign/envelope_rows.h"
#include "harness/cli/suite.h"
#include "harness/engine/flight_job.h"
#include "harness/report/results.h"

namespace tiltproof::harness {

// Removes scenarios that cannot be flown from the suite and returns them with the reasons. For scenarios that
// the user named it throws UsageError with every reason; with `strict` also for those found in a folder. Also
// throws UsageError when the emulator has no image for a scenario.
std::vector<NotApplicable> RemoveNotApplicable(const FlightMeans& means, bool strict, Suite& suite);

// For each row the reason that its fault cannot act in the flight, or would change nothing on this vehicle; empty: it can. The
// fault takes the place of the base's fault of type harness.null.
std::vector<std::string> ReasonsAgainst(const FlightMeans& means, const SuiteScenario& base,
                                        std::span<const EnvelopeRow> rows);

// The reason that this fault cannot be injected into a flight of the scenario in lockstep; empty: it can.
std::string ReasonAgainstInjecting(const FlightMeans& means, const Scenario& scenario,
                                   const faults::FaultSpec& fault);

// One line, with its place, for each formula of the scenario that names the supervisor state of a client that tells none, and
// for a heading that the shipped firmware does not keep. Throws UsageError when the emulator has no image for the scenario.
std::vector<std::string> ClientProblems(const RunClients& clients, const Scenario& scenario);

}  // namespace tiltproof::harness
