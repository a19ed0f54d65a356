#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "harness/cli/commands.h"
#include "harness/cli/compare_command.h"
#include "harness/cli/run_folder.h"
#include "harness/report/files.h"
#include "harness/report/json_text.h"
#include "harness/report/regression.h"
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

BaselineJson ToJson(const FlightChange& flight) {
  BaselineJson json = {{"scenario", flight.name},
                       {"worse", flight.worse()},
                       {"better", flight.better()},
                       {"verdict", {{"a", Name(flight.before)}, {"b", Name(flight.after)}}},
                       {"criteria", BaselineJson::array()}};
  for (const CriterionChange& criterion : flight.criteria)
    json["criteria"].push_back(
        {{"name", criterion.name},
         {"worse", criterion.worse},
         {"verdict",
          {{"a", VerdictJson(criterion.verdict_before)}, {"b", VerdictJson(criterion.verdict_after)}}},
         {"margin",
          {{"a", MarginJson(criterion.margin_before)}, {"b", MarginJson(criterion.margin_after)}}}});
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

std::string Text(const CriterionChange& criterion) {
  if (!criterion.verdict_after) return criterion.name + ": not judged any more";
  std::string text = criterion.name + ":";
  if (criterion.verdict_before != criterion.verdict_after)
    text +=
        fmt::format(" {} before, {} now;", Name(*criterion.verdict_before), Name(*criterion.verdict_after));
  if (criterion.margin_before && criterion.margin_after)
    return text + " " + MarginText(*criterion.margin_before, *criterion.margin_after);
  text.pop_back();
  return text;
}

void PrintFlightLine(const char* word, const std::string& name, const std::string& what) {
  PrintLine(stdout, 0, fmt::format("{:<8} {}{}{}", word, name, what.empty() ? "" : ": ", what));
}

void PrintChange(const FlightChange& flight) {
  const std::string verdicts =
      flight.before == flight.after
          ? ""
          : fmt::format("{} before, {} now", Name(flight.before), Name(flight.after));
  if (flight.worse()) {
    PrintFlightLine("WORSE", flight.name, verdicts);
    for (const CriterionChange& criterion : flight.criteria)
      if (criterion.worse) PrintLine(stdout, kBelow, Text(criterion));
  } else if (flight.after < flight.before) {
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
void WarnOfOtherFlights(const Regression& regression, const OldRun& a, const OldRun& b) {
  for (const FlightChange& flight : regression.flights) {
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

void PrintSummary(const Regression& regression, double tolerance) {
  const std::size_t worse = regression.worse_count(), better = regression.better_count(),
                    all = regression.flights.size();
  std::string text = fmt::format("{} of {} flights worse, {} better, {} the same (margins within {:g})",
                                 worse, all, better, all - worse - better, tolerance);
  if (!regression.missing.empty()) text += fmt::format(", {} only in A", regression.missing.size());
  if (!regression.added.empty()) text += fmt::format(", {} only in B", regression.added.size());
  PrintLine(stdout, 0, text);
}

}  // namespace

// 0 when nothing got worse, 1 when something did or a flight is missing.
int BaselineCommand(const CompareOptions& options) {
  const OldRun a = OpenRun(options.a), b = OpenRun(options.b);
  std::vector<FlightResult> before = ResultsOf(a), now = ResultsOf(b);
  // Two flights are a pair whatever they are called; where one was asked for, the others are not missing.
  if (!a.whole && !b.whole && !before.empty() && !now.empty()) now.front().name = before.front().name;
  Regression regression = CompareResults(before, now, options.tolerance);
  if (!b.whole) regression.missing.clear();
  if (!a.whole) regression.added.clear();
  if (regression.flights.empty())
    throw UsageError(
        fmt::format("{} and {} have no scenario of the same name", options.a.string(), options.b.string()));
  for (const auto& [letter, run] : {std::pair('A', &a), std::pair('B', &b)})
    if (run->whole && run->info.interrupted)
      PrintLine(stderr, 0,
                fmt::format("warning: {} is an unfinished run: flights that did not end are errors", letter));
  if (a.whole && b.whole) WarnOfOtherFlights(regression, a, b);

  if (options.format == "jsonl") {
    for (const FlightChange& flight : regression.flights) Print(stdout, "{}\n", JsonLine(ToJson(flight)));
    for (const std::string& name : regression.missing)
      Print(stdout, "{}\n", JsonLine({{"scenario", name}, {"only_in", "a"}}));
    for (const std::string& name : regression.added)
      Print(stdout, "{}\n", JsonLine({{"scenario", name}, {"only_in", "b"}}));
  } else {
    for (const FlightChange& flight : regression.flights) PrintChange(flight);
    for (const std::string& name : regression.missing) {
      const auto left_out = std::find_if(b.info.not_applicable.begin(), b.info.not_applicable.end(),
                                         [&](const NotApplicable& other) { return other.name == name; });
      PrintFlightLine(
          "MISSING", name,
          left_out == b.info.not_applicable.end() ? "only in A" : "not applicable in B: " + left_out->reason);
    }
    for (const std::string& name : regression.added) PrintFlightLine("new", name, "only in B");
    PrintSummary(regression, options.tolerance);
  }
  return regression.worse() ? kExitNotGreen : kExitGreen;
}

}  // namespace tiltproof::harness
