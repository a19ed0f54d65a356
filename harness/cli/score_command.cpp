#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <map>
#include <memory>

#include "harness/cli/console.h"
#include "harness/cli/replay_line.h"
#include "harness/cli/run_folder.h"
#include "harness/cli/shared_options.h"
#include "harness/cli/suite.h"
#include "harness/report/files.h"
#include "harness/report/flight_files.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {
namespace {

struct ScoreCommandOptions {
  std::filesystem::path run;
  std::string program = "tiltproof";  // as it was called, for the commands that are printed
  std::string format = "human";
};

// From the flight's files; criteria are those of scenario.resolved.yaml as it stands now.
FlightResult ScoreAgain(const std::filesystem::path& folder, const std::string& program) {
  const Scenario scenario = LoadFlown(folder).scenario;
  const std::string name = folder.filename();
  const std::string replay = ReplayLine(program, folder);
  if (!HasEnded(folder)) return NotFlown({name, scenario.expected(), scenario.seed});
  try {
    const FlightResult then = ReadVerdict(folder);
    if (then.trace_hash.empty()) return then;  // it left no flight to score
    const FlightResult result = MakeResult(name, scenario, ReadFlight(folder, scenario), then.replay);
    if (then.trace_hash != result.trace_hash)
      throw std::runtime_error(
          fmt::format("{} is not the trace that was flown: its hash is {}, in verdict.json {}",
                      FindTrace(folder).string(), result.trace_hash, then.trace_hash));
    return result;
  } catch (const std::exception& error) {
    // Its files are damaged, which must not pass unseen.
    Print(stderr, "tiltproof: {}: {}\n", name, error.what());
    return MakeErrorResult(name, scenario, error.what(), replay);
  }
}

// Scores the whole run: in the order of the plan, with the flights that never started.
std::vector<FlightResult> ScoreAll(const OldRun& run, const std::string& program) {
  std::vector<FlightResult> results;
  if (!run.whole || run.info.flights.empty()) {
    for (const auto& folder : run.scenario_folders) results.push_back(ScoreAgain(folder, program));
    return results;
  }
  // Flights that were not kept stay as they were judged.
  std::map<std::string, FlightResult> judged;
  if (run.info.keep != Keep::kAll)
    for (FlightResult& result : ReadResults(run.folder)) judged[result.name] = std::move(result);
  for (const PlannedFlight& flight : run.info.flights) {
    const auto folder = run.folder / flight.name;
    const auto then = judged.find(flight.name);
    results.push_back(HasBegun(folder)       ? ScoreAgain(folder, program)
                      : then != judged.end() ? then->second
                                             : NotFlown(flight));
  }
  return results;
}

// Writes the results of the run again: they may be older than its last flights (when its process was killed), or
// than its criteria.
int ScoreCommand(const ScoreCommandOptions& options) {
  const OldRun run = OpenRun(options.run);
  if (run.info.trace == TraceFormat::kNone)
    throw UsageError(fmt::format("{}: flown with --trace none, and without a trace there is nothing to score",
                                 options.run.string()));
  const Console console(options.format == "jsonl");
  const std::vector<FlightResult> results = ScoreAll(run, options.program);
  for (const auto& result : results) console.Finished(result);
  if (run.whole) {
    WriteResults(run.folder, run.info, results);
    // The events of flights that were not kept are only in that file.
    if (run.info.keep == Keep::kAll) WriteRunEvents(run.folder, results);
  }
  console.Summary(results, 0, run.whole ? run.info.not_applicable.size() : 0, false);
  return ExitCode(results);
}

}  // namespace

void RegisterScore(CLI::App& program, CommandLine& line) {
  const auto options = std::make_shared<ScoreCommandOptions>();
  options->program = line.words.front();
  CLI::App* command = program.add_subcommand(
      "score", "Score an old run again from its files, and write its results.json and junit.xml");
  command->add_option("RUN", options->run, "A run's results folder, or one scenario's folder in it")
      ->required();
  AddFormat(*command, options->format, "human or jsonl");
  SetAction(*command, line, [options] { return ScoreCommand(*options); });
}

}  // namespace tiltproof::harness
