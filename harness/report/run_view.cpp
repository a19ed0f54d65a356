#include "harness/report/run_view.h"

#include <algorithm>
#include <limits>
#include <map>

#include "harness/score/headline.h"

namespace tiltproof::harness {
namespace {

std::vector<FlightResult> ResultsOf(RunEntry& run) {
  try {
    return ReadResults(run.folder);
  } catch (const std::exception& error) {
    run.problem = error.what();
  }
  std::vector<FlightResult> results;
  for (const PlannedFlight& flight : run.info.flights) results.push_back(NotFlown(flight));
  return results;
}

// Flights without a margin stand behind those that failed and before those that passed.
double Rank(const FlightEntry& flight) {
  if (flight.margin) return *flight.margin;
  return flight.result.score.verdict == Verdict::kPass ? std::numeric_limits<double>::max() : 0.0;
}

}  // namespace

RunView ViewRuns(const std::vector<ReportedRun>& runs) {
  RunView view;
  for (const ReportedRun& reported : runs) {
    RunEntry& run = view.runs.emplace_back();
    run.folder = reported.folder;
    run.info = ReadRunInfo(reported.folder);
    for (FlightResult& result : ResultsOf(run)) {
      if (!reported.flight.empty() && result.name != reported.flight) continue;
      FlightEntry flight{
          .run = view.runs.size() - 1, .result = std::move(result), .margin = {}, .before = {}};
      flight.margin = LeastMargin(flight.result.score);
      flight.has_folder = std::filesystem::exists(run.folder / flight.result.name / "scenario.resolved.yaml");
      view.flights.push_back(std::move(flight));
    }
  }
  std::stable_sort(view.flights.begin(), view.flights.end(),
                   [](const FlightEntry& a, const FlightEntry& b) { return Rank(a) < Rank(b); });
  return view;
}

void CompareWith(RunView& view, const std::filesystem::path& baseline) {
  std::map<std::string, FlightBefore> before;
  for (const FlightResult& result : ReadResults(baseline))
    before[result.name] = {result.score.verdict, LeastMargin(result.score)};
  view.baseline = baseline.string();
  for (FlightEntry& flight : view.flights) {
    const auto found = before.find(flight.result.name);
    if (found != before.end()) flight.before = found->second;
  }
  for (const FlightEntry& flight : view.flights) before.erase(flight.result.name);
  for (const auto& [name, result] : before) view.only_in_baseline.push_back(name);
}

}  // namespace tiltproof::harness
