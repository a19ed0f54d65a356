#include "harness/cli/run_plan.h"

#include <fmt/format.h>

#include "harness/cli/commands.h"
#include "harness/report/results.h"

namespace tiltproof::harness {
namespace {

std::string SeededName(const std::string& scenario, std::uint64_t seed) {
  return fmt::format("{}-seed{}", scenario, seed);
}

}  // namespace

bool NotGreen::Flew(const Scenario& scenario) const {
  return name == scenario.name || name == SeededName(scenario.name, seed);
}

std::vector<NotGreen> NotGreenOfLastRun(const std::filesystem::path& out) {
  const std::filesystem::path folder = out / "latest";
  if (!std::filesystem::exists(folder / "run.json"))
    throw UsageError(
        fmt::format("--last-failed: there is no last run in {}; run once without --last-failed, "
                    "or name the folder of your runs with --out",
                    folder.string()));
  std::vector<NotGreen> found;
  try {
    for (const FlightResult& result : ReadResults(folder))
      if (!result.green()) found.push_back({result.name, result.seed});
  } catch (const std::exception& error) {
    throw UsageError(
        fmt::format("--last-failed: the last run cannot be read: {}; run once without it, or "
                    "`tiltproof score {}` writes its results again",
                    error.what(), folder.string()));
  }
  return found;
}

std::vector<PlannedRun> PlanRun(const RunOptions& options, const std::vector<SuiteScenario>& scenarios,
                                const std::vector<NotGreen>* last) {
  const bool repeats = options.repeat_count > 1;
  std::vector<PlannedRun> plan;
  for (std::size_t i = 0; i < scenarios.size(); ++i) {
    const Scenario& scenario = scenarios[i].scenario;
    if (last != nullptr && !options.seed && !repeats) {
      for (const NotGreen& flight : *last)
        if (flight.Flew(scenario)) plan.push_back({i, flight.seed, flight.name});
      continue;
    }
    const std::uint64_t first = options.seed.value_or(scenario.seed);
    if (kSeedMax - first < static_cast<std::uint64_t>(options.repeat_count) - 1)
      throw UsageError(fmt::format("--repeat {}: from seed {} on the seeds exceed {}", options.repeat_count,
                                   first, kSeedMax));
    for (int repeat = 0; repeat < options.repeat_count; ++repeat) {
      const std::uint64_t seed = first + static_cast<std::uint64_t>(repeat);
      plan.push_back({i, seed, repeats ? SeededName(scenario.name, seed) : scenario.name});
    }
  }
  return plan;
}

}  // namespace tiltproof::harness
