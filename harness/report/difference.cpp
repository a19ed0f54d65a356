#include "harness/report/difference.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <stdexcept>
#include <utility>

#include "harness/report/files.h"
#include "harness/report/flight_files.h"
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
    difference.equal =
        difference.equal && (value_a == value_b || (std::isnan(value_a) && std::isnan(value_b)));
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
  FlightResult result = ReadVerdict(folder);
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

const CriterionResult* FindCriterion(const std::vector<CriterionResult>& all, const std::string& name) {
  const auto found =
      std::find_if(all.begin(), all.end(), [&](const auto& other) { return other.name == name; });
  return found == all.end() ? nullptr : &*found;
}

CriterionDifference CompareCriteria(const CriterionResult* a, const CriterionResult* b, double tolerance) {
  CriterionDifference difference;
  difference.name = a != nullptr ? a->name : b->name;
  if (a != nullptr) {
    difference.verdict_a = a->verdict;
    difference.margin_a = a->margin;
  }
  if (b != nullptr) {
    difference.verdict_b = b->verdict;
    difference.margin_b = b->margin;
  }
  if (a == nullptr || b == nullptr) {
    difference.worse = b == nullptr;
    return difference;
  }
  const double more = a->margin && b->margin ? *b->margin - *a->margin : 0.0;
  difference.worse = b->verdict > a->verdict || more < -tolerance;
  difference.better = b->verdict < a->verdict || more > tolerance;
  return difference;
}

}  // namespace

std::vector<std::string> TraceDifference::columns_of_one() const {
  std::vector<std::string> all = columns_of_a;
  all.insert(all.end(), columns_of_b.begin(), columns_of_b.end());
  return all;
}

TraceDifference CompareTraces(const Trace& a, const Trace& b, double tolerance) {
  TraceDifference difference;
  const std::vector<RowPair> rows = MatchRows(a, b);
  difference.rows_a = a.row_count();
  difference.rows_b = b.row_count();
  difference.rows_matched = rows.size();
  if (a.row_count() > 0) difference.end_a_s = TimeOf(a, a.row_count() - 1);
  if (b.row_count() > 0) difference.end_b_s = TimeOf(b, b.row_count() - 1);

  std::vector<ColumnPair> columns;
  const std::vector<std::size_t> states = FindVehicleColumns(a).states;
  for (std::size_t c = 0; c < a.columns().size(); ++c) {
    const std::string& name = a.columns()[c];
    const auto in_b = b.Find(name);
    if (!in_b) {
      difference.columns_of_a.push_back(name);
    } else if (name != "t_s") {
      columns.push_back({name, c, *in_b, std::find(states.begin(), states.end(), c) != states.end()});
    }
  }
  for (const std::string& name : b.columns())
    if (!a.Find(name)) difference.columns_of_b.push_back(name);

  for (const ColumnPair& column : columns) difference.columns.push_back(CompareColumn(a, b, rows, column));
  std::stable_sort(difference.columns.begin(), difference.columns.end(),
                   [](const ColumnDifference& x, const ColumnDifference& y) { return x.max > y.max; });
  difference.first = FindFirst(a, b, rows, columns, tolerance);
  return difference;
}

FlightDifference CompareResults(FlightResult a, FlightResult b, double tolerance) {
  std::string name = a.name;
  FlightDifference flight{
      .name = std::move(name), .a = std::move(a), .b = std::move(b), .criteria = {}, .trace = {}};
  const Score &before = flight.a.score, &after = flight.b.score;
  // An error has no criteria: its verdict says it all.
  if (before.verdict == Verdict::kError || after.verdict == Verdict::kError) return flight;
  for (const CriterionResult& criterion : before.criteria)
    flight.criteria.push_back(
        CompareCriteria(&criterion, FindCriterion(after.criteria, criterion.name), tolerance));
  for (const CriterionResult& criterion : after.criteria)
    if (FindCriterion(before.criteria, criterion.name) == nullptr)
      flight.criteria.push_back(CompareCriteria(nullptr, &criterion, tolerance));
  return flight;
}

FlightDifference CompareFlights(const std::filesystem::path& folder_a, const std::filesystem::path& folder_b,
                                double tolerance) {
  Flown a = ReadFlown(folder_a);
  Flown b = ReadFlown(folder_b);
  FlightDifference flight = CompareResults(std::move(a.result), std::move(b.result), tolerance);
  flight.trace = CompareTraces(a.trace, b.trace, tolerance);
  return flight;
}

bool FlightDifference::worse() const {
  return b.score.verdict > a.score.verdict ||
         std::any_of(criteria.begin(), criteria.end(), [](const auto& c) { return c.worse; });
}

bool FlightDifference::better() const {
  return !worse() && (b.score.verdict < a.score.verdict ||
                      std::any_of(criteria.begin(), criteria.end(), [](const auto& c) { return c.better; }));
}

FlightPairs PairFlights(const NamedFlights& a, const NamedFlights& b) {
  FlightPairs pairing;
  if (!a.whole && !b.whole && !a.names.empty() && !b.names.empty()) {
    pairing.pairs.emplace_back(0, 0);
    return pairing;
  }
  std::map<std::string, std::size_t> places_b;
  for (std::size_t i = 0; i < b.names.size(); ++i) places_b.emplace(b.names[i], i);
  std::vector<bool> paired(b.names.size(), false);
  for (std::size_t i = 0; i < a.names.size(); ++i) {
    const auto found = places_b.find(a.names[i]);
    if (found != places_b.end()) {
      pairing.pairs.emplace_back(i, found->second);
      paired[found->second] = true;
    } else if (b.whole) {
      pairing.only_a.push_back(i);
    }
  }
  for (std::size_t i = 0; i < b.names.size(); ++i)
    if (a.whole && !paired[i]) pairing.only_b.push_back(i);
  return pairing;
}

std::size_t RunDifference::worse_count() const {
  return static_cast<std::size_t>(
      std::count_if(flights.begin(), flights.end(), [](const auto& flight) { return flight.worse(); }));
}

std::size_t RunDifference::better_count() const {
  return static_cast<std::size_t>(
      std::count_if(flights.begin(), flights.end(), [](const auto& flight) { return flight.better(); }));
}

RunDifference CompareRuns(const std::vector<FlightResult>& a, const std::vector<FlightResult>& b,
                          double tolerance, bool whole_a, bool whole_b) {
  const auto names = [](const std::vector<FlightResult>& results) {
    std::vector<std::string> all;
    for (const FlightResult& result : results) all.push_back(result.name);
    return all;
  };
  const FlightPairs pairing = PairFlights({names(a), whole_a}, {names(b), whole_b});
  RunDifference run;
  for (const auto& [i, j] : pairing.pairs) run.flights.push_back(CompareResults(a[i], b[j], tolerance));
  for (const std::size_t i : pairing.only_a) run.only_a.push_back(a[i].name);
  for (const std::size_t i : pairing.only_b) run.only_b.push_back(b[i].name);
  return run;
}

}  // namespace tiltproof::harness
