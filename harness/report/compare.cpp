#include "harness/report/compare.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <utility>

#include "harness/report/files.h"
#include "harness/report/trace_file.h"
#include "harness/score/signals.h"

namespace tiltproof::harness {
namespace {

using RowPair = std::pair<std::size_t, std::size_t>;

// Rows of equal time.
std::vector<RowPair> MatchRows(const Trace& a, const Trace& b) {
  const std::vector<TimeNs> times_a = RowTimes(a), times_b = RowTimes(b);
  std::vector<RowPair> pairs;
  for (std::size_t i = 0, j = 0; i < times_a.size() && j < times_b.size();) {
    if (times_a[i] == times_b[j]) {
      pairs.emplace_back(i++, j++);
    } else {
      times_a[i] < times_b[j] ? ++i : ++j;
    }
  }
  return pairs;
}

// Infinite when only one has a value, or they are different infinities.
double Apart(std::string_view column, double a, double b) {
  if (std::isnan(a) && std::isnan(b)) return 0.0;
  if (a == b) return 0.0;
  if (!std::isfinite(a) || !std::isfinite(b)) return std::numeric_limits<double>::infinity();
  return std::abs(column.ends_with("_rad") ? std::remainder(a - b, 2 * std::numbers::pi) : a - b);
}

double TimeOf(const Trace& trace, std::size_t row) { return trace.at(row, *trace.Find("t_s")); }

struct ColumnPair {
  std::string name;
  std::size_t a, b;
  bool is_state;  // of the vehicle
};

ColumnDifference CompareColumn(const Trace& a, const Trace& b, const std::vector<RowPair>& rows,
                               const ColumnPair& column) {
  ColumnDifference difference;
  difference.column = column.name;
  difference.is_vehicle = column.is_state;
  double squares = 0.0;
  std::size_t count = 0;
  for (const auto& [i, j] : rows) {
    const double value_a = a.at(i, column.a), value_b = b.at(j, column.b);
    const double distance = Apart(column.name, value_a, value_b);
    if (std::isinf(distance)) ++difference.one_sided_rows;
    if (!std::isfinite(value_a) || !std::isfinite(value_b)) continue;
    ++count;
    squares += distance * distance;
    if (distance <= difference.max) continue;
    difference.max = distance;
    difference.max_time_s = TimeOf(a, i);
  }
  if (count > 0) difference.rms = std::sqrt(squares / static_cast<double>(count));
  return difference;
}

std::optional<FirstDifference> FindFirst(const Trace& a, const Trace& b, const std::vector<RowPair>& rows,
                                         const std::vector<ColumnPair>& columns, double tolerance) {
  for (const auto& [i, j] : rows) {
    const ColumnPair* worst = nullptr;
    double worst_distance = tolerance;
    for (const ColumnPair& column : columns) {
      if (!column.is_state) continue;
      const double distance = Apart(column.name, a.at(i, column.a), b.at(j, column.b));
      if (distance <= worst_distance) continue;
      worst = &column;
      worst_distance = distance;
    }
    if (worst != nullptr)
      return FirstDifference{i, TimeOf(a, i), worst->name, a.at(i, worst->a), b.at(j, worst->b)};
  }
  return std::nullopt;
}

struct Flown {
  FlightResult result;
  Trace trace;
};

Flown ReadFlown(const std::filesystem::path& folder) {
  const auto verdict_file = folder / "verdict.json";
  const std::string verdict = ReadFile(verdict_file);
  FlightResult result;
  try {
    result = ResultFromJsonText(verdict);
  } catch (const std::exception& error) {
    throw std::runtime_error(fmt::format("{}: {}", verdict_file.string(), error.what()));
  }
  if (result.trace_hash.empty())
    throw std::runtime_error(fmt::format("{}: no flight: {}", folder.string(), result.score.reason));
  Trace trace = ReadTrace(folder);
  try {
    if (const std::string hash = TraceHash(trace); hash != result.trace_hash)
      throw std::runtime_error(fmt::format("not the trace that was flown: its hash is {}, in verdict.json {}",
                                           hash, result.trace_hash));
    RowTimes(trace);
    return {std::move(result), std::move(trace)};
  } catch (const std::exception& error) {
    throw std::runtime_error(fmt::format("{}: {}", FindTrace(folder).string(), error.what()));
  }
}

}  // namespace

TraceComparison CompareTraces(const Trace& a, const Trace& b, double tolerance) {
  TraceComparison comparison;
  const std::vector<RowPair> rows = MatchRows(a, b);
  comparison.rows_a = a.row_count();
  comparison.rows_b = b.row_count();
  comparison.rows_matched = rows.size();
  if (a.row_count() > 0) comparison.end_a_s = TimeOf(a, a.row_count() - 1);
  if (b.row_count() > 0) comparison.end_b_s = TimeOf(b, b.row_count() - 1);

  std::vector<ColumnPair> columns;
  const std::vector<std::size_t> states = FindVehicleColumns(a).states;
  for (std::size_t c = 0; c < a.columns().size(); ++c) {
    const std::string& name = a.columns()[c];
    const auto in_b = b.Find(name);
    if (!in_b) {
      comparison.columns_of_one.push_back(name);
    } else if (name != "t_s") {
      columns.push_back({name, c, *in_b, std::find(states.begin(), states.end(), c) != states.end()});
    }
  }
  for (const std::string& name : b.columns())
    if (!a.Find(name)) comparison.columns_of_one.push_back(name);

  for (const ColumnPair& column : columns) comparison.columns.push_back(CompareColumn(a, b, rows, column));
  std::stable_sort(comparison.columns.begin(), comparison.columns.end(),
                   [](const ColumnDifference& x, const ColumnDifference& y) { return x.max > y.max; });
  comparison.first = FindFirst(a, b, rows, columns, tolerance);
  return comparison;
}

FlightComparison CompareFlights(const std::filesystem::path& folder_a, const std::filesystem::path& folder_b,
                                double tolerance) {
  Flown a = ReadFlown(folder_a);
  Flown b = ReadFlown(folder_b);
  FlightComparison comparison;
  comparison.identical = a.result.trace_hash == b.result.trace_hash;
  comparison.trace = CompareTraces(a.trace, b.trace, tolerance);
  comparison.a = std::move(a.result);
  comparison.b = std::move(b.result);
  return comparison;
}

}  // namespace tiltproof::harness
