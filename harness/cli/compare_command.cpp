#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <utility>

#include "harness/cli/commands.h"
#include "harness/cli/compare_command.h"
#include "harness/cli/run_folder.h"
#include "harness/cli/shared_options.h"
#include "harness/report/difference.h"
#include "harness/report/files.h"
#include "harness/report/json_text.h"
#include "harness/report/machine.h"
#include "harness/scenario/differing_key.h"
#include "harness/terminal/lines.h"
#include "harness/terminal/terminal.h"
#include "link/time.h"

namespace tiltproof::harness {

using Json = nlohmann::ordered_json;

void RefuseUnpaired(const CompareOptions& options) {
  throw UsageError(
      fmt::format("{} and {} have no scenario of the same name", options.a.string(), options.b.string()));
}

void PrintOnlyIn(const char* letter, const std::vector<std::string>& names) {
  for (const std::string& name : names)
    Print(stdout, "{}\n", JsonLine({{"scenario", name}, {"only_in", letter}}));
}
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kVehicleColumnsShown = 5;
constexpr std::size_t kOtherColumnsShown = 3;

constexpr std::array<const char*, 10> kMetrics = {
    "timing.request_period_mean_ms", "timing.request_period_p50_ms", "timing.request_period_p99_ms",
    "timing.request_period_max_ms",  "timing.reply_latency_p50_ms",  "timing.reply_latency_p99_ms",
    "timing.reply_latency_max_ms",   "timing.firmware_missed_count", "tracking.rmse_m",
    "tracking.max_error_m"};

std::string_view UnitOf(std::string_view column) {
  constexpr std::array<std::pair<std::string_view, std::string_view>, 6> kUnits = {
      {{"_rad_s", "rad/s"}, {"_m_s", "m/s"}, {"_rad", "rad"}, {"_nm", "N m"}, {"_m", "m"}, {"_n", "N"}}};
  for (const auto& [suffix, unit] : kUnits)
    if (column.ends_with(suffix)) return unit;
  return "";
}

std::string WithUnit(double value, std::string_view column) {
  const std::string_view unit = UnitOf(column);
  return fmt::format("{:.3g}{}{}", value, unit.empty() ? "" : " ", unit);
}

std::vector<std::string> NamesOf(const OldRun& run) {
  std::vector<std::string> names;
  for (const fs::path& folder : run.scenario_folders) names.push_back(folder.filename());
  return names;
}

// By which keys the two are different flights. Throws UsageError when there are any, unless `anyway`.
std::vector<std::string> FlightDifferences(const fs::path& a, const fs::path& b, bool anyway) {
  std::vector<std::string> keys;
  try {
    keys = DifferingKeys(ReadFile(a / "scenario.resolved.yaml"), ReadFile(b / "scenario.resolved.yaml"));
  } catch (const std::exception& error) {
    throw std::runtime_error(fmt::format("{} or {}: {}", (a / "scenario.resolved.yaml").string(),
                                         (b / "scenario.resolved.yaml").string(), error.what()));
  }
  if (!keys.empty() && !anyway)
    throw UsageError(
        fmt::format("{} and {} are different flights, so their traces cannot be compared: {}; --anyway "
                    "compares them all the same",
                    a.string(), b.string(), keys.front()));
  return keys;
}

std::optional<double> Metric(const FlightResult& result, const std::string& name) {
  const auto found = result.score.metrics.find(name);
  if (found == result.score.metrics.end()) return std::nullopt;
  return found->second;
}

std::string DifferenceWord(const FlightDifference& flight) {
  return flight.differs() ? "DIFFERENT" : flight.identical() ? "IDENTICAL" : "CLOSE";
}

Json JsonOf(const FlightDifference& flight, const std::vector<std::string>& unlike) {
  const TraceDifference& trace = *flight.trace;
  const auto number = [](double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); };
  Json json = {{"scenario", flight.name},
               {"differs", flight.differs()},
               {"identical", flight.identical()},
               {"different_flights", unlike},
               {"verdict", {{"a", Name(flight.a.score.verdict)}, {"b", Name(flight.b.score.verdict)}}},
               {"trace_hash", {{"a", flight.a.trace_hash}, {"b", flight.b.trace_hash}}},
               {"rows", {{"a", trace.rows_a}, {"b", trace.rows_b}, {"matched", trace.rows_matched}}},
               {"end_s", {{"a", trace.end_a_s}, {"b", trace.end_b_s}}},
               {"first_difference", nullptr}};
  if (const auto& first = trace.first)
    json["first_difference"] = {{"time_s", first->time_s},
                                {"period", first->row},
                                {"column", first->column},
                                {"a", number(first->a)},
                                {"b", number(first->b)}};
  json["columns"] = Json::array();
  for (const ColumnDifference& column : trace.columns)
    json["columns"].push_back({{"name", column.column},
                               {"max", column.max},
                               {"time_s", column.max_time_s},
                               {"rms", column.rms},
                               {"one_sided_rows", column.one_sided_rows}});
  json["columns_of_one"] = trace.columns_of_one();
  json["metrics"] = Json::object();
  for (const std::string name : kMetrics) {
    const auto a = Metric(flight.a, name), b = Metric(flight.b, name);
    if (a || b)
      json["metrics"][name] = {{"a", a ? Json(*a) : Json(nullptr)}, {"b", b ? Json(*b) : Json(nullptr)}};
  }
  return json;
}

// Prints the vehicle, then inputs, commands and counters; the sensors' columns are the vehicle's state once more.
void PrintColumns(const TraceDifference& trace) {
  Print(stdout, "    {:<34} {:>14} {:>10} {:>12}\n", "column", "max difference", "at (s)", "rms");
  std::size_t vehicle = 0, others = 0, more = 0;
  for (const bool is_vehicle : {true, false}) {
    for (const ColumnDifference& column : trace.columns) {
      if (column.is_vehicle != is_vehicle || (column.max == 0.0 && column.one_sided_rows == 0)) continue;
      std::size_t& shown = is_vehicle ? vehicle : others;
      const std::size_t shown_max = is_vehicle ? kVehicleColumnsShown : kOtherColumnsShown;
      if (shown == shown_max || column.column.starts_with("sensed_")) {
        ++more;
        continue;
      }
      ++shown;
      Print(stdout, "    {:<34} {:>14} {:>10.3f} {:>12.3g}\n", column.column,
            WithUnit(column.max, column.column), column.max_time_s, column.rms);
      if (column.one_sided_rows > 0)
        PrintLine(stdout, 6, fmt::format("{} rows in one flight only", column.one_sided_rows));
    }
  }
  if (more > 0) Print(stdout, "    ... and {} more that differ; --format jsonl has all\n", more);
}

void PrintMetrics(const FlightDifference& flight) {
  bool first = true;
  for (const std::string name : kMetrics) {
    const auto a = Metric(flight.a, name), b = Metric(flight.b, name);
    if (a == b) continue;
    if (std::exchange(first, false))
      Print(stdout, "    {:<34} {:>14} {:>10} {:>12}\n", "metric", "A", "B", "B - A");
    const auto text = [](std::optional<double> value) { return value ? fmt::format("{:.7g}", *value) : "-"; };
    Print(stdout, "    {:<34} {:>14} {:>10} {:>12}\n", name, text(a), text(b),
          a && b ? fmt::format("{:+.3g}", *b - *a) : "");
  }
}

// Differences between the two, a line each: first the keys by which they were different flights.
std::vector<std::string> Differences(const FlightDifference& flight, const std::vector<std::string>& unlike,
                                     double tolerance) {
  const TraceDifference& trace = *flight.trace;
  std::vector<std::string> lines;
  if (const auto& first = trace.first) {
    const auto value = [](double v) { return std::isnan(v) ? "no value" : fmt::format("{:.6g}", v); };
    lines.push_back(
        fmt::format("apart by more than {:g} from {:.3f} s on (period {}): {} is {} in A, {} in B", tolerance,
                    first->time_s, first->row, first->column, value(first->a), value(first->b)));
  }
  if (!flight.same_verdict())
    lines.push_back(
        fmt::format("verdict {} in A, {} in B", Name(flight.a.score.verdict), Name(flight.b.score.verdict)));
  if (!trace.same_rows()) {
    lines.push_back(fmt::format("{} rows to {:.3f} s in A, {} to {:.3f} s in B; {} in both", trace.rows_a,
                                trace.end_a_s, trace.rows_b, trace.end_b_s, trace.rows_matched));
  }
  if (lines.empty())
    lines.push_back(flight.identical()
                        ? "to the bit"
                        : fmt::format("the vehicle is nowhere apart by more than {:g}", tolerance));
  for (auto key = unlike.rbegin(); key != unlike.rend(); ++key)
    lines.insert(lines.begin(), fmt::format("different flights: {}", *key));
  return lines;
}

void PrintFlight(const FlightDifference& flight, const std::vector<std::string>& unlike, double tolerance) {
  const TraceDifference& trace = *flight.trace;
  const std::vector<std::string> lines = Differences(flight, unlike, tolerance);
  if (IsTerminal(stdout)) {
    PrintLine(stdout, 0, fmt::format("{:<10} {}", DifferenceWord(flight), flight.name));
    for (const std::string& line : lines) PrintLine(stdout, 4, line);
  } else {
    Print(stdout, "{:<10} {:<34} {}\n", DifferenceWord(flight), flight.name, lines.front());
    for (std::size_t i = 1; i < lines.size(); ++i) Print(stdout, "{:<45} {}\n", "", lines[i]);
  }
  if (flight.identical()) return;
  PrintColumns(trace);
  if (!trace.columns_of_one().empty())
    PrintLine(stdout, 4, fmt::format("in one trace only: {}", fmt::join(trace.columns_of_one(), ", ")));
  PrintMetrics(flight);
}

std::string RunText(const char* letter, const fs::path& path, const RunInfo& info) {
  return fmt::format("{}: {}  (client {}, {}, {})", letter, path.string(), info.client, info.mode,
                     info.started);
}

std::string NameOf(const fs::path& folder_a, const fs::path& folder_b) {
  const std::string a = folder_a.filename(), b = folder_b.filename();
  return a == b ? a : fmt::format("{} and {}", a, b);
}

struct Counts {
  std::size_t identical = 0, close = 0, different = 0, unreadable = 0;
};

void ComparePair(const fs::path& folder_a, const fs::path& folder_b, const CompareOptions& options,
                 const std::vector<std::string>& unlike, Counts& counts) {
  const bool jsonl = options.format == "jsonl";
  const std::string name = NameOf(folder_a, folder_b);
  try {
    FlightDifference flight = CompareFlights(folder_a, folder_b, options.tolerance);
    flight.name = name;
    ++(flight.differs() ? counts.different : flight.identical() ? counts.identical : counts.close);
    jsonl ? Print(stdout, "{}\n", JsonLine(JsonOf(flight, unlike)))
          : PrintFlight(flight, unlike, options.tolerance);
  } catch (const std::exception& error) {
    ++counts.unreadable;
    if (jsonl) Print(stdout, "{}\n", JsonLine({{"scenario", name}, {"error", error.what()}}));
    Print(stderr, "{:<10} {:<34} {}\n", "UNREADABLE", name, error.what());
  }
}

void PrintUnmatched(const char* letter, const std::vector<std::string>& names,
                    const std::vector<std::size_t>& only, bool jsonl) {
  std::vector<std::string> unmatched;
  for (const std::size_t i : only) unmatched.push_back(names[i]);
  if (jsonl) return PrintOnlyIn(letter, unmatched);
  for (const std::string& name : unmatched)
    Print(stdout, "{:<10} {:<34} only in {}\n", "UNMATCHED", name, letter == std::string("a") ? 'A' : 'B');
}

// 0 when nothing differs by more than the tolerance, 1 when something does, 3 when files of a flight cannot be
// read; the other flights are compared all the same.
int CompareCommand(const CompareOptions& options) {
  const OldRun a = OpenRun(options.a), b = OpenRun(options.b);
  const std::vector<std::string> names_a = NamesOf(a), names_b = NamesOf(b);
  const FlightPairs pairing = PairFlights({names_a, a.whole}, {names_b, b.whole});
  if (pairing.pairs.empty()) RefuseUnpaired(options);
  std::vector<std::vector<std::string>> unlike;  // of each pair
  for (const auto& [i, j] : pairing.pairs)
    unlike.push_back(FlightDifferences(a.scenario_folders[i], b.scenario_folders[j], options.anyway));
  const bool jsonl = options.format == "jsonl";
  if (!jsonl) {
    PrintLine(stdout, 0, RunText("A", options.a, a.info));
    PrintLine(stdout, 0, RunText("B", options.b, b.info));
  }

  Counts counts;
  for (std::size_t k = 0; k < pairing.pairs.size(); ++k) {
    const auto& [i, j] = pairing.pairs[k];
    ComparePair(a.scenario_folders[i], b.scenario_folders[j], options, unlike[k], counts);
  }
  PrintUnmatched("a", names_a, pairing.only_a, jsonl);
  PrintUnmatched("b", names_b, pairing.only_b, jsonl);
  const std::string machines = MachineDifference(a.info.machine, b.info.machine, "in A", "in B");
  if (!jsonl) {
    if (counts.different > 0 && !machines.empty()) PrintLine(stdout, 0, "another machine: " + machines);
    std::string text = fmt::format(
        "{} of {} flights identical, {} within {:g} (m, rad, m/s, rad/s), {} different", counts.identical,
        pairing.pairs.size(), counts.close, options.tolerance, counts.different);
    if (counts.unreadable > 0) text += fmt::format(", {} unreadable", counts.unreadable);
    if (!pairing.only_a.empty()) text += fmt::format(", {} only in A", pairing.only_a.size());
    if (!pairing.only_b.empty()) text += fmt::format(", {} only in B", pairing.only_b.size());
    PrintLine(stdout, 0, text);
  }
  if (counts.unreadable > 0) return kExitError;
  return counts.different > 0 || !pairing.only_a.empty() || !pairing.only_b.empty() ? kExitNotGreen
                                                                                    : kExitGreen;
}

}  // namespace

void RegisterCompare(CLI::App& program, CommandLine& line) {
  const auto options = std::make_shared<CompareOptions>();
  const auto baseline = std::make_shared<bool>(false), outcomes = std::make_shared<bool>(false);
  CLI::App* command = program.add_subcommand(
      "compare", "Compare the flights of two runs: traces, timing, verdicts (0 equal, 1 different)");
  command->add_option("A", options->a, "A run's results folder, or one scenario's folder in it")->required();
  command->add_option("B", options->b, "Another one")->required();
  command
      ->add_option("--tolerance", options->tolerance,
                   "Largest difference allowed in a state of the vehicle, in its unit (m, rad, m/s, rad/s); "
                   "with --baseline the largest fall of a margin")
      ->check(CLI::Range(0.0, 1e9))
      ->capture_default_str();
  AddFormat(*command, options->format, "human or jsonl");
  auto* baseline_flag = command->add_flag(
      "--baseline", *baseline,
      "A is the baseline: 1 when a verdict or a margin of B is worse, or a flight of A is missing, else 0");
  auto* anyway_flag = command
                          ->add_flag("--anyway", options->anyway,
                                     "Compare different flights, too (another seed, link, fault, ...), and "
                                     "say by which keys they differ")
                          ->excludes(baseline_flag);
  command
      ->add_flag("--outcomes", *outcomes,
                 "A is one flight without faults, B a campaign: class each flight of B as crashed, hung, "
                 "failed, detected, wrong_output or masked, and count them")
      ->excludes(baseline_flag)
      ->excludes(anyway_flag);
  SetAction(*command, line, [options, baseline, outcomes] {
    return *baseline   ? BaselineCommand(*options)
           : *outcomes ? OutcomesCommand(*options)
                       : CompareCommand(*options);
  });
}

}  // namespace tiltproof::harness
