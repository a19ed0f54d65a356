#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "harness/cli/commands.h"
#include "harness/cli/compare_command.h"
#include "harness/cli/run_folder.h"
#include "harness/report/difference.h"
#include "harness/report/files.h"
#include "harness/report/json_text.h"
#include "harness/scenario/differing_key.h"
#include "harness/terminal/lines.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {
namespace {

using BaselineJson = nlohmann::ordered_json;

constexpr std::size_t kBelow = 6;  // spaces before what stands below a flight's line

BaselineJson VerdictJson(std::optional<Verdict> verdict) {
  return verdict ? BaselineJson(Name(*verdict)) : BaselineJson();
}

BaselineJson MarginJson(std::optional<double> margin) {
  return margin ? BaselineJson(*margin) : BaselineJson();
}

BaselineJson ToJson(const FlightDifference& flight) {
  BaselineJson json = {
      {"scenario", flight.name},
      {"worse", flight.worse()},
      {"better", flight.better()},
      {"verdict", {{"a", Name(flight.a.score.verdict)}, {"b", Name(flight.b.score.verdict)}}},
      {"criteria", BaselineJson::array()}};
  for (const CriterionDifference& criterion : flight.criteria)
    json["criteria"].push_back(
        {{"name", criterion.name},
         {"worse", criterion.worse},
         {"verdict", {{"a", VerdictJson(criterion.verdict_a)}, {"b", VerdictJson(criterion.verdict_b)}}},
         {"margin", {{"a", MarginJson(criterion.margin_a)}, {"b", MarginJson(criterion.margin_b)}}}});
  return json;
}

// "margin 0.21 before, -0.4 now", with as many digits as tell them apart.
std::string MarginText(double before, double after) {
  for (int digits = 3; digits < 17; ++digits) {
    const std::string a = fmt::format("{:.{}g}", before, digits), b = fmt::format("{:.{}g}", after, digits);
    if (a != b) return fmt::format("margin {} before, {} now", a, b);
  }
  return fmt::format("margin {}, as before", before);
}

std::string Text(const CriterionDifference& criterion) {
  if (!criterion.verdict_b) return criterion.name + ": not judged any more";
  std::string text = criterion.name + ":";
  if (criterion.verdict_a != criterion.verdict_b)
    text += fmt::format(" {} before, {} now;", Name(*criterion.verdict_a), Name(*criterion.verdict_b));
  if (criterion.margin_a && criterion.margin_b)
    return text + " " + MarginText(*criterion.margin_a, *criterion.margin_b);
  text.pop_back();
  return text;
}

void PrintFlightLine(const char* word, const std::string& name, const std::string& what) {
  PrintLine(stdout, 0, fmt::format("{:<8} {}{}{}", word, name, what.empty() ? "" : ": ", what));
}

void PrintChange(const FlightDifference& flight) {
  const std::string verdicts =
      flight.same_verdict()
          ? ""
          : fmt::format("{} before, {} now", Name(flight.a.score.verdict), Name(flight.b.score.verdict));
  if (flight.worse()) {
    PrintFlightLine("WORSE", flight.name, verdicts);
    for (const CriterionDifference& criterion : flight.criteria)
      if (criterion.worse) PrintLine(stdout, kBelow, Text(criterion));
  } else if (flight.b.score.verdict < flight.a.score.verdict) {
    PrintFlightLine("better", flight.name, verdicts);
  }
}

std::vector<FlightResult> ResultsOf(const OldRun& run) {
  std::vector<FlightResult> results = ReadResults(run.folder);
  if (!run.whole) {
    const std::string name = run.scenario_folders.front().filename();
    std::erase_if(results, [&](const FlightResult& result) { return result.name != name; });
  }
  return results;
}

// Warns of changes besides the firmware and the criteria: margins of different flights say little of each other.
void WarnOfOtherFlights(const RunDifference& runs, const OldRun& a, const OldRun& b) {
  for (const FlightDifference& flight : runs.flights) {
    const auto text_in = [&](const OldRun& run) {
      return ReadFile((run.whole ? run.folder / flight.name : run.scenario_folders.front()) /
                      "scenario.resolved.yaml");
    };
    try {
      if (const auto keys = DifferingKeys(text_in(a), text_in(b)); !keys.empty())
        PrintLine(stderr, 0,
                  fmt::format("warning: {} is another flight in B: {}", flight.name, keys.front()));
    } catch (const std::exception&) {
      // It left no folder (--keep): its results are all there is.
    }
  }
}

void PrintSummary(const RunDifference& runs, double tolerance) {
  const std::size_t worse = runs.worse_count(), better = runs.better_count(), all = runs.flights.size();
  std::string text = fmt::format("{} of {} flights worse, {} better, {} the same (margins within {:g})",
                                 worse, all, better, all - worse - better, tolerance);
  if (!runs.only_a.empty()) text += fmt::format(", {} only in A", runs.only_a.size());
  if (!runs.only_b.empty()) text += fmt::format(", {} only in B", runs.only_b.size());
  PrintLine(stdout, 0, text);
}

}  // namespace

// 0 when nothing got worse, 1 when something did or a flight is missing.
int BaselineCommand(const CompareOptions& options) {
  const OldRun a = OpenRun(options.a), b = OpenRun(options.b);
  const RunDifference runs = CompareRuns(ResultsOf(a), ResultsOf(b), options.tolerance, a.whole, b.whole);
  if (runs.flights.empty()) RefuseUnpaired(options);
  for (const auto& [letter, run] : {std::pair('A', &a), std::pair('B', &b)})
    if (run->whole && run->info.interrupted)
      PrintLine(stderr, 0,
                fmt::format("warning: {} is an unfinished run: flights that did not end are errors", letter));
  if (a.whole && b.whole) WarnOfOtherFlights(runs, a, b);

  if (options.format == "jsonl") {
    for (const FlightDifference& flight : runs.flights) Print(stdout, "{}\n", JsonLine(ToJson(flight)));
    PrintOnlyIn("a", runs.only_a);
    PrintOnlyIn("b", runs.only_b);
  } else {
    for (const FlightDifference& flight : runs.flights) PrintChange(flight);
    for (const std::string& name : runs.only_a) {
      const auto left_out = std::find_if(b.info.not_applicable.begin(), b.info.not_applicable.end(),
                                         [&](const NotApplicable& other) { return other.name == name; });
      PrintFlightLine(
          "MISSING", name,
          left_out == b.info.not_applicable.end() ? "only in A" : "not applicable in B: " + left_out->reason);
    }
    for (const std::string& name : runs.only_b) PrintFlightLine("new", name, "only in B");
    PrintSummary(runs, options.tolerance);
  }
  return runs.worse() ? kExitNotGreen : kExitGreen;
}

}  // namespace tiltproof::harness
