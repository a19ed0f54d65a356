#include "harness/cli/stated_computing.h"

#include "harness/cli/run_flights.h"

namespace tiltproof::harness {

std::string WhyNoComputing(const FlightMeans& means, const SuiteScenario& entry) {
  const FlownFlights flown = RunFlights({FlightJob{.name = entry.scenario.name,
                                                   .scenario = entry.scenario,
                                                   .model = entry.model,
                                                   .means = means,
                                                   .replay = {}}},
                                        {});
  if (flown.results.empty()) return "";
  const Score& score = flown.results.front().score;
  if (score.verdict == Verdict::kError || StatesComputing(score)) return "";
  return "stretches the computing time that a firmware states, and this one states none (docs/nmpc.md)";
}

}  // namespace tiltproof::harness
