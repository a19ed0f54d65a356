// The folder of an old or present run, as the commands that read one see it.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "harness/report/results.h"

namespace tiltproof::harness {

struct OldRun {
  RunInfo info;
  std::vector<std::filesystem::path> scenario_folders;
};
// `path` is a run's folder or the folder of one scenario in it. Throws UsageError when it is neither.
OldRun OpenRun(const std::filesystem::path& path);

// Gathers the scenarios' events in events.jsonl, one JSON object a line.
void WriteRunEvents(const std::filesystem::path& folder, const std::vector<ScenarioResult>& results);

}  // namespace tiltproof::harness
