#include <fmt/format.h>

#include <map>
#include <nlohmann/json.hpp>

#include "harness/cli/commands.h"
#include "harness/cli/compare_command.h"
#include "harness/cli/run_folder.h"
#include "harness/report/files.h"
#include "harness/report/flight_files.h"
#include "harness/report/json_text.h"
#include "harness/report/outcomes.h"
#include "harness/report/results.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {
namespace {

namespace fs = std::filesystem;

// Effects of the faults, from the events that report them.
std::string Strikes(const FlightResult& result) {
  std::string text;
  for (const FlightEvent& event : result.events)
    if (event.kind == "bit_flipped") text += fmt::format("; {} at {:.3f} s", event.text, event.time_s);
  return text;
}

// With those of flights that left none.
std::vector<fs::path> FoldersOf(const OldRun& run) {
  if (!run.whole || run.info.flights.empty()) return run.scenario_folders;
  std::vector<fs::path> folders;
  for (const PlannedFlight& flight : run.info.flights) folders.push_back(run.folder / flight.name);
  return folders;
}

FlightResult ReadFlown(const fs::path& folder, Keep keep) {
  if (!HasEnded(folder))
    throw std::runtime_error(keep == Keep::kAll ? kNotFlown
                                                : fmt::format("it left no folder (--keep {})", Name(keep)));
  FlightResult result = ReadVerdict(folder);
  if (result.trace_hash.empty()) return result;
  const RunLog log = ReadFlight(folder);
  result.events = EventsOf(log);
  if (!result.outcome) result.outcome = OutcomeOf(log, result.score);  // of an older version
  if (!result.end_reason) result.end_reason = log.end_reason;
  return result;
}

}  // namespace

// 0 when every planned flight could be classed, else 3.
int OutcomesCommand(const CompareOptions& options) {
  const OldRun golden = OpenRun(options.a), campaign = OpenRun(options.b);
  if (golden.scenario_folders.size() != 1)
    throw UsageError(fmt::format(
        "{}: --outcomes takes one flight as its reference, and here are {}; give the folder of one",
        options.a.string(), golden.scenario_folders.size()));
  const OutcomeReference reference(golden.scenario_folders.front());
  const bool jsonl = options.format == "jsonl";
  std::map<std::string, std::pair<std::size_t, std::size_t>>
      counts;  // flights, and those of them that passed
  bool unreadable = false;
  for (const fs::path& folder : FoldersOf(campaign)) {
    const std::string name = folder.filename();
    try {
      const FlightResult result = ReadFlown(folder, campaign.info.keep);
      const std::string outcome = reference.OutcomeOf(result, folder);
      const bool passed = result.score.verdict == Verdict::kPass;
      ++counts[outcome].first;
      counts[outcome].second += passed ? 1 : 0;
      if (jsonl) {
        Print(stdout, "{}\n",
              JsonLine({{"scenario", name}, {"outcome", outcome}, {"verdict", Name(result.score.verdict)}}));
      } else if (outcome != "masked") {
        Print(stdout, "{}: {}, {}{}\n", name, outcome, Name(result.score.verdict), Strikes(result));
      }
    } catch (const std::exception& error) {
      unreadable = true;
      Print(stderr, "{}: no outcome: {}\n", name, error.what());
    }
  }
  if (!jsonl) {
    Print(stdout, "\n| outcome | flights | of these passed |\n|---|---|---|\n");
    for (const std::string& name : OutcomeNames())
      Print(stdout, "| {} | {} | {} |\n", name, counts[name].first, counts[name].second);
  }
  return unreadable ? kExitError : kExitGreen;
}

}  // namespace tiltproof::harness
