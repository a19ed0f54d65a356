#include <fmt/format.h>

#include "harness/cli/commands.h"
#include "harness/cli/console.h"
#include "harness/cli/run_folder.h"
#include "harness/cli/suite.h"
#include "harness/report/files.h"
#include "harness/report/flight_files.h"

namespace tiltproof::harness {

// Pure: reads the files of the flights and writes none. Criteria are those of scenario.resolved.yaml as it
// stands now.
int ScoreCommand(const ReplayOptions& options) {
  const OldRun run = OpenRun(options.run);
  const Console console(options.format == "jsonl");
  std::vector<ScenarioResult> results;
  for (const auto& folder : run.scenario_folders) {
    const Scenario scenario = LoadFlown(folder).scenario;
    const std::string name = folder.filename();
    const std::string replay = fmt::format("{} replay {}", options.program, folder.string());
    ScenarioResult result;
    try {
      result = MakeResult(name, scenario, ReadFlight(folder), replay);
      const ScenarioResult then = ResultFromJsonText(ReadFile(folder / "verdict.json"));
      if (then.trace_hash != result.trace_hash)
        throw std::runtime_error(
            fmt::format("{} is not the trace that was flown: its hash is {}, in verdict.json {}",
                        (folder / "trace.csv").string(), result.trace_hash, then.trace_hash));
    } catch (const std::exception& error) {
      // It ended in an error then, or its files are damaged now: either way it must not pass unseen.
      result = MakeErrorResult(name, scenario, error.what(), replay);
    }
    console.Finished(result);
    results.push_back(std::move(result));
  }
  console.Summary(results, {}, false);
  return ExitCode(results);
}

}  // namespace tiltproof::harness
