// Compares two flights of one scenario: how far their traces are apart, where they diverge, and whether
// timing and verdicts agree.
//
//   const FlightComparison comparison = CompareFlights(folder_a, folder_b, 1e-3);
//   if (comparison.differs()) Print(stdout, "{}\n", comparison.trace.first->column);
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "harness/report/results.h"
#include "harness/run/trace.h"
#include "link/time.h"

namespace tiltproof::harness {

// Rows are matched by their time. Differences of angles (columns in _rad) are taken the short way round.
struct ColumnDifference {
  std::string column;
  bool is_vehicle = false;         // one of the states of the vehicle, which decide
  double max = 0.0;                // in the column's unit, over the rows where both have a value
  double max_time_s = 0.0;         // of the first row with that difference
  double rms = 0.0;                // over the same rows
  std::size_t one_sided_rows = 0;  // rows where not both have a finite value, and differ
};

struct FirstDifference {
  std::size_t row = 0;  // in A, from 0: one row every control period
  double time_s = 0.0;
  std::string column;
  double a = 0.0, b = 0.0;  // NaN: no value
};

struct TraceComparison {
  std::size_t rows_a = 0, rows_b = 0, rows_matched = 0;
  double end_a_s = 0.0, end_b_s = 0.0;    // time of the last row
  std::vector<ColumnDifference> columns;  // of both traces, without time; the worst first
  std::vector<std::string> columns_of_one;
  // The first row in which the vehicle's state differs by more than the tolerance; in that row the column
  // with the greatest difference.
  std::optional<FirstDifference> first;

  bool same_rows() const { return rows_matched == rows_a && rows_matched == rows_b; }
};

// Throws std::invalid_argument when a trace has no ascending time.
TraceComparison CompareTraces(const Trace& a, const Trace& b, double tolerance);

struct FlightComparison {
  FlightResult a, b;
  bool identical = false;  // the trace hashes are equal
  TraceComparison trace;

  bool differs() const { return trace.first || !trace.same_rows() || a.score.verdict != b.score.verdict; }
};

// Reads both folders of a scenario (verdict.json, trace.csv). Throws std::exception naming the file that
// cannot be read, or why there is no flight.
FlightComparison CompareFlights(const std::filesystem::path& folder_a, const std::filesystem::path& folder_b,
                                double tolerance);

}  // namespace tiltproof::harness
