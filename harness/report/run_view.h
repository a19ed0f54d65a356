// Content of a report on one or several runs: their flights as results.json has them, the least margin first, and
// which of them left files.
//
//   RunView view = ViewRuns({{"results/latest", ""}});
//   CompareWith(view, "results/of-last-week");
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "harness/report/results.h"

namespace tiltproof::harness {

struct ReportedRun {
  std::filesystem::path folder;
  std::string flight;  // its only flight that is reported; empty: all
};

struct FlightBefore {
  Verdict verdict{};
  std::optional<double> margin;
};

struct FlightEntry {
  std::size_t run = 0;  // in RunView::runs
  FlightResult result;
  std::optional<double> margin;  // of its headline criterion (harness/score/headline.h)
  bool has_folder = false;
  std::optional<FlightBefore> before;  // in the baseline
};

struct RunEntry {
  std::filesystem::path folder;
  RunInfo info;
  std::string
      problem;  // why results.json could not be read; its flights are then those of run.json, not flown
};

struct RunView {
  std::vector<RunEntry> runs;
  std::vector<FlightEntry> flights;
  std::string baseline;                       // folder; empty: none
  std::vector<std::string> only_in_baseline;  // names of flights
};

// Throws std::runtime_error when a folder has no run.json.
RunView ViewRuns(const std::vector<ReportedRun>& runs);

// Adds what the flights of the same names were in another run. Throws what ReadResults throws.
void CompareWith(RunView& view, const std::filesystem::path& baseline);

}  // namespace tiltproof::harness
