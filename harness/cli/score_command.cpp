#include <fmt/format.h>

#include "harness/cli/commands.h"
#include "harness/cli/console.h"
#include "harness/cli/run_folder.h"
#include "harness/cli/suite.h"
#include "harness/report/flight_files.h"
#include "harness/report/trace_csv.h"

namespace tiltproof::harness {

// Pure: reads the files of the flights and writes none. Criteria are those of scenario.resolved.yaml as it
// stands now.
int ScoreCommand(const ReplayOptions& options) {
  const OldRun run = OpenRun(options.run);
  const Console console(options.format == "jsonl");
  std::vector<ScenarioResult> results;
  for (const auto& folder : run.scenario_folders) {
    const Scenario scenario = LoadFlown(folder).scenario;
    RunLog log;
    try {
      log = ReadFlight(folder);
    } catch (const std::exception& error) {
      throw UsageError(error.what());
    }
    ScenarioResult result;
    result.name = folder.filename();
    result.expected = scenario.expect;
    result.seed = scenario.seed;
    result.trace_hash = TraceHash(log.trace);
    result.wall_s = log.wall_s;
    result.real_time_factor = log.wall_s > 0 ? ToSeconds(log.end_ns) / log.wall_s : 0.0;
    result.replay = fmt::format("{} replay {}", options.program, folder.string());
    result.score = ScoreRun(scenario, log);
    console.Finished(result);
    results.push_back(std::move(result));
  }
  console.Summary(results, {}, false);
  return ExitCode(results);
}

}  // namespace tiltproof::harness
