#include "harness/cli/run_folder.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "harness/cli/commands.h"
#include "harness/report/files.h"
#include "harness/report/flight_hashes.h"
#include "harness/report/json_fields.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {
namespace {

constexpr const char* kScenarioFile = "scenario.resolved.yaml";

// Its criteria may have been edited, to score the flight again.
void WarnOfChange(const std::filesystem::path& scenario_folder) {
  const auto file = scenario_folder / kScenarioFile;
  try {
    if (HasChanged(file)) Print(stderr, "warning: {} has changed since the flight\n", file.string());
  } catch (const FileError&) {
    // Its reader names it.
  }
}

}  // namespace

OldRun OpenRun(const std::filesystem::path& path) {
  namespace fs = std::filesystem;
  const fs::path folder = fs::exists(path) ? fs::canonical(path) : path;
  OldRun run;
  try {
    if (HasBegun(folder)) {
      run.folder = folder.parent_path();
      run.info = ReadRunInfo(run.folder);
      run.whole = false;
      run.scenario_folders = {folder};
      WarnOfChange(folder);
      return run;
    }
    run.folder = folder;
    run.info = ReadRunInfo(folder);
  } catch (const std::runtime_error& error) {
    throw UsageError(fmt::format("{} is neither a run's results folder nor a scenario's in it: {}",
                                 path.string(), error.what()));
  }
  for (const auto& entry : fs::directory_iterator(folder))
    if (entry.is_directory() && HasBegun(entry.path())) run.scenario_folders.push_back(entry.path());
  std::sort(run.scenario_folders.begin(), run.scenario_folders.end());
  for (const fs::path& scenario_folder : run.scenario_folders) WarnOfChange(scenario_folder);
  if (run.scenario_folders.empty() && run.info.flights.empty())
    throw UsageError(fmt::format("{}: no scenario was flown in this run", path.string()));
  return run;
}

bool HasBegun(const std::filesystem::path& scenario_folder) {
  return std::filesystem::exists(scenario_folder / kScenarioFile);
}

bool HasEnded(const std::filesystem::path& scenario_folder) {
  return std::filesystem::exists(scenario_folder / "verdict.json");
}

void WriteRunEvents(const std::filesystem::path& folder, const std::vector<FlightResult>& results) {
  std::string lines;
  for (const auto& result : results) {
    for (const FlightEvent& event : result.events) {
      Json line = {{"scenario", result.name}};
      JsonWriter::PutFields(line, event);
      lines += JsonText(line) + "\n";
    }
  }
  WriteFile(folder / "events.jsonl", lines);
}

}  // namespace tiltproof::harness
