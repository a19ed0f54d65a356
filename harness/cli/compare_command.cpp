#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "harness/cli/commands.h"
#include "harness/cli/run_folder.h"
#include "harness/report/compare.h"
#include "harness/report/files.h"
#include "harness/report/json_text.h"
#include "harness/report/machine.h"
#include "harness/scenario/differing_key.h"
#include "harness/terminal/lines.h"
#include "harness/terminal/terminal.h"
#include "link/time.h"

namespace tiltproof::harness {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

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

// The flights that both runs have, and the names of those that only one has.
struct Pairing {
  std::vector<std::pair<fs::path, fs::path>> pairs;
  std::vector<std::string> only_a, only_b;
};

Pairing Pair(const CompareOptions& options, const OldRun& a, const OldRun& b) {
  const bool one_a = !a.whole, one_b = !b.whole;
  Pairing pairing;
  // Two scenarios' folders are a pair whatever they are called.
  if (one_a && one_b) {
    pairing.pairs.emplace_back(a.scenario_folders[0], b.scenario_folders[0]);
    return pairing;
  }
  const auto named = [](const OldRun& run, const fs::path& name) {
    return std::find_if(run.scenario_folders.begin(), run.scenario_folders.end(),
                        [&](const fs::path& folder) { return folder.filename() == name; });
  };
  for (const fs::path& folder : a.scenario_folders) {
    const auto found = named(b, folder.filename());
    if (found != b.scenario_folders.end()) {
      pairing.pairs.emplace_back(folder, *found);
    } else if (!one_b) {  // where one scenario was asked for, the others are not missing
      pairing.only_a.push_back(folder.filename());
    }
  }
  for (const fs::path& folder : b.scenario_folders)
    if (!one_a && named(a, folder.filename()) == a.scenario_folders.end())
      pairing.only_b.push_back(folder.filename());
  if (pairing.pairs.empty())
    throw UsageError(
        fmt::format("{} and {} have no scenario of the same name", options.a.string(), options.b.string()));
  return pairing;
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

std::string DifferenceWord(const FlightComparison& comparison) {
  return comparison.differs() ? "DIFFERENT" : comparison.identical ? "IDENTICAL" : "CLOSE";
}

Json JsonOf(const std::string& scenario, const FlightComparison& c, const std::vector<std::string>& unlike) {
  const auto number = [](double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); };
  Json json = {{"scenario", scenario},
               {"differs", c.differs()},
               {"identical", c.identical},
               {"different_flights", unlike},
               {"verdict", {{"a", Name(c.a.score.verdict)}, {"b", Name(c.b.score.verdict)}}},
               {"trace_hash", {{"a", c.a.trace_hash}, {"b", c.b.trace_hash}}},
               {"rows", {{"a", c.trace.rows_a}, {"b", c.trace.rows_b}, {"matched", c.trace.rows_matched}}},
               {"end_s", {{"a", c.trace.end_a_s}, {"b", c.trace.end_b_s}}},
               {"first_difference", nullptr}};
  if (const auto& first = c.trace.first)
    json["first_difference"] = {{"time_s", first->time_s},
                                {"period", first->row},
                                {"column", first->column},
                                {"a", number(first->a)},
                                {"b", number(first->b)}};
  json["columns"] = Json::array();
  for (const ColumnDifference& column : c.trace.columns)
    json["columns"].push_back({{"name", column.column},
                               {"max", column.max},
                               {"time_s", column.max_time_s},
                               {"rms", column.rms},
                               {"one_sided_rows", column.one_sided_rows}});
  json["columns_of_one"] = c.trace.columns_of_one;
  json["metrics"] = Json::object();
  for (const std::string name : kMetrics) {
    const auto a = Metric(c.a, name), b = Metric(c.b, name);
    if (a || b)
      json["metrics"][name] = {{"a", a ? Json(*a) : Json(nullptr)}, {"b", b ? Json(*b) : Json(nullptr)}};
  }
  return json;
}

// Prints the vehicle, then inputs, commands and counters; the sensors' columns are the vehicle's state once more.
void PrintColumns(const TraceComparison& trace) {
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

void PrintMetrics(const FlightComparison& c) {
  bool first = true;
  for (const std::string name : kMetrics) {
    const auto a = Metric(c.a, name), b = Metric(c.b, name);
    if (a == b) continue;
    if (std::exchange(first, false))
      Print(stdout, "    {:<34} {:>14} {:>10} {:>12}\n", "metric", "A", "B", "B - A");
    const auto text = [](std::optional<double> value) { return value ? fmt::format("{:.7g}", *value) : "-"; };
    Print(stdout, "    {:<34} {:>14} {:>10} {:>12}\n", name, text(a), text(b),
          a && b ? fmt::format("{:+.3g}", *b - *a) : "");
  }
}

// Differences between the two, a line each: first the keys by which they were different flights.
std::vector<std::string> Differences(const FlightComparison& c, const std::vector<std::string>& unlike,
                                     double tolerance) {
  std::vector<std::string> lines;
  if (const auto& first = c.trace.first) {
    const auto value = [](double v) { return std::isnan(v) ? "no value" : fmt::format("{:.6g}", v); };
    lines.push_back(
        fmt::format("apart by more than {:g} from {:.3f} s on (period {}): {} is {} in A, {} in B", tolerance,
                    first->time_s, first->row, first->column, value(first->a), value(first->b)));
  }
  if (c.a.score.verdict != c.b.score.verdict)
    lines.push_back(
        fmt::format("verdict {} in A, {} in B", Name(c.a.score.verdict), Name(c.b.score.verdict)));
  if (!c.trace.same_rows()) {
    lines.push_back(fmt::format("{} rows to {:.3f} s in A, {} to {:.3f} s in B; {} in both", c.trace.rows_a,
                                c.trace.end_a_s, c.trace.rows_b, c.trace.end_b_s, c.trace.rows_matched));
  }
  if (lines.empty())
    lines.push_back(c.identical ? "to the bit"
                                : fmt::format("the vehicle is nowhere apart by more than {:g}", tolerance));
  for (auto key = unlike.rbegin(); key != unlike.rend(); ++key)
    lines.insert(lines.begin(), fmt::format("different flights: {}", *key));
  return lines;
}

void PrintFlight(const std::string& name, const FlightComparison& c, const std::vector<std::string>& unlike,
                 double tolerance) {
  const std::vector<std::string> lines = Differences(c, unlike, tolerance);
  if (IsTerminal(stdout)) {
    PrintLine(stdout, 0, fmt::format("{:<10} {}", DifferenceWord(c), name));
    for (const std::string& line : lines) PrintLine(stdout, 4, line);
  } else {
    Print(stdout, "{:<10} {:<34} {}\n", DifferenceWord(c), name, lines.front());
    for (std::size_t i = 1; i < lines.size(); ++i) Print(stdout, "{:<45} {}\n", "", lines[i]);
  }
  if (c.identical) return;
  PrintColumns(c.trace);
  if (!c.trace.columns_of_one.empty())
    PrintLine(stdout, 4, fmt::format("in one trace only: {}", fmt::join(c.trace.columns_of_one, ", ")));
  PrintMetrics(c);
}

std::string RunText(const char* letter, const fs::path& path, const RunInfo& info) {
  return fmt::format("{}: {}  (client {}, {}, {})", letter, path.string(), info.client, info.mode,
                     info.started);
}

std::string NameOf(const std::pair<fs::path, fs::path>& pair) {
  const std::string a = pair.first.filename(), b = pair.second.filename();
  return a == b ? a : fmt::format("{} and {}", a, b);
}

}  // namespace

// 0 when nothing differs by more than the tolerance, 1 when something does, 3 when files of a flight cannot be
// read; the other flights are compared all the same.
int CompareCommand(const CompareOptions& options) {
  const OldRun a = OpenRun(options.a), b = OpenRun(options.b);
  const Pairing pairing = Pair(options, a, b);
  std::vector<std::vector<std::string>> unlike;  // of each pair
  for (const auto& [folder_a, folder_b] : pairing.pairs)
    unlike.push_back(FlightDifferences(folder_a, folder_b, options.anyway));
  const bool jsonl = options.format == "jsonl";
  if (!jsonl) {
    PrintLine(stdout, 0, RunText("A", options.a, a.info));
    PrintLine(stdout, 0, RunText("B", options.b, b.info));
  }

  std::size_t identical = 0, close = 0, different = 0, unreadable = 0;
  for (std::size_t i = 0; i < pairing.pairs.size(); ++i) {
    const auto& pair = pairing.pairs[i];
    const std::string name = NameOf(pair);
    try {
      const FlightComparison comparison = CompareFlights(pair.first, pair.second, options.tolerance);
      ++(comparison.differs() ? different : comparison.identical ? identical : close);
      jsonl ? Print(stdout, "{}\n", JsonLine(JsonOf(name, comparison, unlike[i])))
            : PrintFlight(name, comparison, unlike[i], options.tolerance);
    } catch (const std::exception& error) {
      ++unreadable;
      if (jsonl) Print(stdout, "{}\n", JsonLine({{"scenario", name}, {"error", error.what()}}));
      Print(stderr, "{:<10} {:<34} {}\n", "UNREADABLE", name, error.what());
    }
  }
  for (const auto& [letter, names] : {std::pair("a", &pairing.only_a), std::pair("b", &pairing.only_b)}) {
    for (const std::string& name : *names)
      jsonl ? Print(stdout, "{}\n", JsonLine({{"scenario", name}, {"only_in", letter}}))
            : Print(stdout, "{:<10} {:<34} only in {}\n", "UNMATCHED", name,
                    letter == std::string("a") ? 'A' : 'B');
  }
  const std::string machines = MachineDifference(a.info.machine, b.info.machine, "in A", "in B");
  if (!jsonl) {
    if (different > 0 && !machines.empty()) PrintLine(stdout, 0, "another machine: " + machines);
    std::string text =
        fmt::format("{} of {} flights identical, {} within {:g} (m, rad, m/s, rad/s), {} different",
                    identical, pairing.pairs.size(), close, options.tolerance, different);
    if (unreadable > 0) text += fmt::format(", {} unreadable", unreadable);
    if (!pairing.only_a.empty()) text += fmt::format(", {} only in A", pairing.only_a.size());
    if (!pairing.only_b.empty()) text += fmt::format(", {} only in B", pairing.only_b.size());
    PrintLine(stdout, 0, text);
  }
  if (unreadable > 0) return kExitError;
  return different > 0 || !pairing.only_a.empty() || !pairing.only_b.empty() ? kExitNotGreen : kExitGreen;
}

}  // namespace tiltproof::harness
