// The folder of an old or current run, as the commands that read one see it.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "harness/report/results.h"

namespace tiltproof::harness {

struct OldRun {
  RunInfo info;
  std::filesystem::path folder;                         // the run's
  bool whole = true;                                    // otherwise one of its scenarios was requested
  std::vector<std::filesystem::path> scenario_folders;  // those that are there
};
// `path` is a run's folder or the folder of one scenario in it. Prints a warning for each scenario that has changed since
// its flight. Throws UsageError when it is neither, or when nothing was to be flown.
OldRun OpenRun(const std::filesystem::path& path);

// HasBegun(): true if a flight started. HasEnded(): true if it reached a verdict.
bool HasBegun(const std::filesystem::path& scenario_folder);
bool HasEnded(const std::filesystem::path& scenario_folder);

// Gathers the scenarios' events in events.jsonl, one JSON object per line.
void WriteRunEvents(const std::filesystem::path& folder, const std::vector<FlightResult>& results);

}  // namespace tiltproof::harness
