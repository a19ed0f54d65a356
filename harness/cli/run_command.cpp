#include <fmt/format.h>
#include <unistd.h>

#include <nlohmann/json.hpp>

#include "harness/cli/commands.h"
#include "harness/cli/console.h"
#include "harness/cli/data_files.h"
#include "harness/cli/run_folder.h"
#include "harness/cli/suite.h"
#include "harness/cli/worker_pool.h"
#include "harness/report/build_id.h"
#include "harness/report/files.h"
#include "harness/report/results.h"
#include "harness/scenario/selection.h"

namespace tiltproof::harness {
namespace {

void CheckMode(const RunOptions& options) {
  if (options.mode == "lockstep") return;
  if (options.mode == "realtime") throw UsageError("--mode realtime: this version flies in lockstep only");
  throw UsageError(fmt::format("--mode {}: must be lockstep", options.mode));
}

// Throws UsageError when -k or --tag is no valid selection.
std::vector<SuiteScenario> Select(std::vector<SuiteScenario> scenarios, const RunOptions& options) {
  try {
    const Selection selection(options.expression, options.tag);
    std::erase_if(scenarios, [&](const auto& entry) { return !selection.Matches(entry.scenario); });
  } catch (const std::invalid_argument& error) {
    throw UsageError(fmt::format("-k {}: {}", options.expression, error.what()));
  }
  return scenarios;
}

// Of one flight, unique in the run: names its folder.
std::string FlightName(const RunOptions& options, const Scenario& scenario, std::uint64_t seed) {
  return options.repeat_count == 1 ? scenario.name : fmt::format("{}-seed{}", scenario.name, seed);
}

// What would be flown, one a line.
void List(const RunOptions& options, const std::vector<SuiteScenario>& scenarios) {
  for (const auto& entry : scenarios) {
    const std::uint64_t first = options.seed.value_or(entry.scenario.seed);
    for (int repeat = 0; repeat < options.repeat_count; ++repeat) {
      const std::uint64_t seed = first + static_cast<std::uint64_t>(repeat);
      const std::string name = FlightName(options, entry.scenario, seed);
      if (options.format == "jsonl") {
        nlohmann::ordered_json line = {{"name", name}, {"scenario", entry.scenario.name}, {"seed", seed}};
        line["expected"] = Name(entry.scenario.expect);
        line["duration_s"] = ToSeconds(entry.scenario.duration_ns);
        fmt::print("{}\n", line.dump());
      } else {
        fmt::print("{}\n", name);
      }
    }
  }
}

}  // namespace

int RunCommand(const RunOptions& options) {
  CheckMode(options);
  const std::filesystem::path library = FirmwareLibrary(options.client);
  Suite suite = LoadSuite(options.paths, options.client);
  const std::size_t found = suite.scenarios.size();
  suite.scenarios = Select(std::move(suite.scenarios), options);
  const Console console(options.format == "jsonl");
  for (const auto& warning : suite.warnings) fmt::print(stderr, "warning: {}\n", warning);
  if (suite.scenarios.empty()) {
    fmt::print(stderr, "tiltproof: nothing selected: {} scenario{} found, none matches\n", found,
               found == 1 ? "" : "s");
    return kExitUndecided;
  }
  for (const auto& entry : suite.scenarios) {
    const std::uint64_t first = options.seed.value_or(entry.scenario.seed);
    if (kSeedMax - first < static_cast<std::uint64_t>(options.repeat_count) - 1)
      throw UsageError(fmt::format("--repeat {}: from seed {} on the seeds exceed {}", options.repeat_count,
                                   first, kSeedMax));
  }
  if (options.dry_run) {
    List(options, suite.scenarios);
    return kExitGreen;
  }

  RunInfo info;
  info.suite = suite.name;
  info.started = UtcNow();
  info.seed = options.seed.value_or(suite.scenarios.front().scenario.seed);
  info.client = library == HostFirmwareLibrary() ? "host" : "library:" + library.string();
  info.build = BuildId(library);
  info.command = options.command;
  const std::filesystem::path folder = CreateRunFolder(options.out, suite.name, info.seed);
  WriteRunInfo(folder, info);
  if (LatestIsTaken(options.out))
    fmt::print(stderr, "warning: {} is no link and stays as it is; this run is in {}\n",
               (options.out / "latest").string(), folder.string());

  std::vector<FlightJob> jobs;
  for (const auto& [scenario, model] : suite.scenarios) {
    for (int repeat = 0; repeat < options.repeat_count; ++repeat) {
      FlightJob job{scenario, model, library, {}, {}};
      job.scenario.seed = options.seed.value_or(scenario.seed) + static_cast<std::uint64_t>(repeat);
      job.folder = folder / FlightName(options, scenario, job.scenario.seed);
      job.replay = fmt::format("{} replay {}", options.command.front(), job.folder.string());
      jobs.push_back(std::move(job));
    }
  }

  console.Line(fmt::format("tiltproof {}: suite {}, {} flight{}, client {}, results in {}", Version(),
                           suite.name, jobs.size(), jobs.size() == 1 ? "" : "s", info.client,
                           folder.string()));
  const bool progress = !options.no_progress && isatty(STDERR_FILENO) != 0;
  const PoolOutcome outcome =
      FlyAll(jobs, {.jobs_count = options.jobs_count, .fail_fast = options.fail_fast, .progress = progress},
             [&](const ScenarioResult& result) { console.Finished(result); });
  info.interrupted = outcome.interrupted;
  WriteRunInfo(folder, info);
  WriteResults(folder, info, outcome.results);
  WriteRunEvents(folder, outcome.results);
  console.Summary(outcome.results, outcome.not_flown, outcome.interrupted);
  return outcome.interrupted ? static_cast<int>(kExitInterrupted) : ExitCode(outcome.results);
}

}  // namespace tiltproof::harness
