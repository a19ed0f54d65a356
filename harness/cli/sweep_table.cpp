#include "harness/cli/sweep_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <set>

#include "harness/score/headline.h"

namespace tiltproof::harness {
namespace {

constexpr const char* kRmse = "tracking.rmse_m";

// RFC 4180: quotes where a comma, a quote or a line break is inside.
std::string CsvCell(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string cell = "\"";
  for (const char c : text) cell += c == '"' ? std::string("\"\"") : std::string(1, c);
  return cell + '"';
}

std::string NumberOrEmpty(const std::optional<double>& value) {
  return value ? fmt::format("{}", *value) : "";
}

std::optional<double> MetricOf(const FlightResult& result, const std::string& name) {
  const auto found = result.score.metrics.find(name);
  return found == result.score.metrics.end() ? std::nullopt : std::optional(found->second);
}

// The last key of each path, or the whole path where two have the same.
std::vector<std::string> ShortPaths(const std::vector<KeySetting>& settings) {
  const auto last_key = [](const std::string& path) { return path.substr(path.rfind('.') + 1); };
  std::vector<std::string> names;
  for (const KeySetting& setting : settings) {
    const auto same = std::ranges::count_if(
        settings, [&](const KeySetting& other) { return last_key(other.path) == last_key(setting.path); });
    names.push_back(same > 1 ? setting.path : last_key(setting.path));
  }
  return names;
}

struct Cell {
  std::size_t flights = 0, passed = 0;
  std::optional<double> margin, rmse_m;
  std::string criterion;
};

Cell CellOf(const std::vector<SweepRow>& rows, const std::string& scenario) {
  Cell cell;
  for (const SweepRow& row : rows) {
    if (row.scenario != scenario) continue;
    ++cell.flights;
    if (row.result.score.verdict == Verdict::kPass) ++cell.passed;
    if (const auto margin = LeastMargin(row.result.score); margin && (!cell.margin || *margin < *cell.margin))
      cell.margin = margin;
    if (const auto rmse_m = MetricOf(row.result, kRmse); rmse_m && (!cell.rmse_m || *rmse_m > *cell.rmse_m))
      cell.rmse_m = rmse_m;
    if (const CriterionResult* first = FirstViolated(row.result.score);
        first != nullptr && cell.criterion.empty())
      cell.criterion = first->name;
  }
  return cell;
}

// Cells of one column begin below each other.
std::vector<std::string> Aligned(const std::vector<std::vector<std::string>>& lines) {
  std::vector<std::size_t> widths;
  for (const auto& line : lines)
    for (std::size_t i = 0; i < line.size(); ++i) {
      if (i == widths.size()) widths.push_back(0);
      widths[i] = std::max(widths[i], line[i].size());
    }
  std::vector<std::string> texts;
  for (const auto& line : lines) {
    std::string& text = texts.emplace_back();
    for (std::size_t i = 0; i < line.size(); ++i) text += fmt::format("{:<{}}  ", line[i], widths[i]);
    text.erase(text.find_last_not_of(' ') + 1);
  }
  return texts;
}

}  // namespace

std::string SweepCsv(const std::vector<SweepRow>& rows) {
  if (rows.empty()) return "";
  std::set<std::string> metrics;
  for (const SweepRow& row : rows)
    for (const auto& [name, value] : row.result.score.metrics) metrics.insert(name);
  std::vector<std::string> line = {"scenario", "seed"};
  for (const KeySetting& setting : rows.front().settings) line.push_back(CsvCell(setting.path));
  for (const char* name : {"verdict", "green", "criterion", "time_s", "margin"}) line.emplace_back(name);
  line.insert(line.end(), metrics.begin(), metrics.end());
  std::string text = fmt::format("{}\n", fmt::join(line, ","));
  for (const SweepRow& row : rows) {
    const Score& score = row.result.score;
    const CriterionResult* first = FirstViolated(score);
    line = {CsvCell(row.scenario), fmt::format("{}", row.result.seed)};
    for (const KeySetting& setting : row.settings) line.push_back(CsvCell(setting.value));
    line.emplace_back(Name(score.verdict));
    line.emplace_back(row.result.green() ? "true" : "false");
    line.push_back(first == nullptr ? "" : CsvCell(first->name));
    line.push_back(NumberOrEmpty(first == nullptr ? std::nullopt : first->time_s));
    line.push_back(NumberOrEmpty(LeastMargin(score)));
    for (const std::string& name : metrics) line.push_back(NumberOrEmpty(MetricOf(row.result, name)));
    text += fmt::format("{}\n", fmt::join(line, ","));
  }
  return text;
}

std::vector<std::string> SweepTable(const std::vector<SweepRow>& rows) {
  if (rows.empty()) return {};
  std::set<std::string> cells, values;
  const auto values_of = [](const SweepRow& row) {
    std::vector<std::string> all;
    for (const KeySetting& setting : row.settings) all.push_back(setting.value);
    return all;
  };
  for (const SweepRow& row : rows) {
    cells.insert(row.scenario);
    values.insert(fmt::format("{}", fmt::join(values_of(row), "\n")));
  }
  const bool names_scenario = values.size() < cells.size();  // several scenarios share the grid
  std::vector<std::vector<std::string>> lines(1);
  if (names_scenario) lines.front().emplace_back("scenario");
  for (std::string& name : ShortPaths(rows.front().settings)) lines.front().push_back(std::move(name));
  for (const char* name : {"passed", "margin", "rmse_m", "fails"}) lines.front().emplace_back(name);
  for (const SweepRow& row : rows) {
    if (cells.erase(row.scenario) == 0) continue;
    const Cell cell = CellOf(rows, row.scenario);
    std::vector<std::string>& line = lines.emplace_back();
    if (names_scenario) line.push_back(row.scenario);
    for (std::string& value : values_of(row)) line.push_back(std::move(value));
    line.push_back(fmt::format("{} of {}", cell.passed, cell.flights));
    line.push_back(cell.margin ? fmt::format("{:.3g}", *cell.margin) : "-");
    line.push_back(cell.rmse_m ? fmt::format("{:.3f}", *cell.rmse_m) : "-");
    line.push_back(cell.criterion);
  }
  return Aligned(lines);
}

}  // namespace tiltproof::harness
