// Selects the flights of a run: every scenario with its seeds, or those that were not green in the last run.
//
//   const std::vector<NotGreen> last = NotGreenOfLastRun("results");
//   for (const PlannedRun& flight : PlanRun(options, suite.scenarios, &last)) Print(stdout, "{}\n", flight.name);
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "harness/cli/run_options.h"
#include "harness/cli/suite.h"

namespace tiltproof::harness {

// A flight of a run that is over.
struct NotGreen {
  std::string name;
  std::uint64_t seed = 0;

  // True if it flew this scenario.
  bool Flew(const Scenario& scenario) const;
};

// Flights of the run to which `latest` in `out` links. Throws UsageError, with advice, when no such run can be read.
std::vector<NotGreen> NotGreenOfLastRun(const std::filesystem::path& out);

struct PlannedRun {
  std::size_t scenario = 0;  // its place
  std::uint64_t seed = 0;
  std::string name;  // unique in the run: names its folder
};

// In the order of the scenarios. `last`: only the flights that were not green, each with its seed, unless --seed or
// --repeat says otherwise; null: all. Throws UsageError when a seed is too large.
std::vector<PlannedRun> PlanRun(const RunOptions& options, const std::vector<SuiteScenario>& scenarios,
                                const std::vector<NotGreen>* last);

}  // namespace tiltproof::harness
