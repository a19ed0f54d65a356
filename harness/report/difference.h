// The differences between two flights, A and B, and between two runs: results, and traces where they are read.
// `compare` with its views --baseline and --outcomes, and `replay`, print parts of it.
//
//   const FlightDifference flight = CompareFlights(folder_a, folder_b, 1e-3);
//   if (flight.differs()) Print(stdout, "{}\n", flight.trace->first->column);
//
//   const RunDifference run = CompareRuns(ReadResults("baseline"), ReadResults("results/latest"), 1e-3);
//   if (run.worse()) Print(stdout, "{} flights are worse\n", run.worse_count());
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
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
  bool equal = true;               // to the bit, in every row
};

struct FirstDifference {
  std::size_t row = 0;  // in A, from 0: one row every control period
  double time_s = 0.0;
  std::string column;
  double a = 0.0, b = 0.0;  // NaN: no value
};

struct TraceDifference {
  std::size_t rows_a = 0, rows_b = 0, rows_matched = 0;
  double end_a_s = 0.0, end_b_s = 0.0;                  // time of the last row
  std::vector<ColumnDifference> columns;                // of both traces, without time; the worst first
  std::vector<std::string> columns_of_a, columns_of_b;  // that the other one lacks
  // The first row in which the vehicle's state differs by more than the tolerance; in that row the column
  // with the greatest difference.
  std::optional<FirstDifference> first;

  std::vector<std::string> columns_of_one() const;
  bool same_rows() const { return rows_matched == rows_a && rows_matched == rows_b; }
};

// Throws std::invalid_argument when a trace has no ascending time.
TraceDifference CompareTraces(const Trace& a, const Trace& b, double tolerance);

// None: it is not judged there.
struct CriterionDifference {
  std::string name;
  std::optional<Verdict> verdict_a, verdict_b;
  std::optional<double> margin_a, margin_b;  // none: it has none
  // A criterion of B is worse when it is not judged any more, or has a worse verdict, or less margin by more than
  // the tolerance. It is better with a better verdict, or more margin by more than the tolerance.
  bool worse = false, better = false;
};

struct FlightDifference {
  std::string name;
  FlightResult a, b;
  std::vector<CriterionDifference>
      criteria;  // in A's order, then those that only B has; none when one is an error
  std::optional<TraceDifference> trace;  // where traces were read

  bool identical() const { return a.trace_hash == b.trace_hash; }
  bool same_verdict() const { return a.score.verdict == b.score.verdict; }
  // By the trace, with the tolerance, or by the verdict.
  bool differs() const { return !same_verdict() || (trace && (trace->first || !trace->same_rows())); }
  // Verdicts in their order of precedence: pass, inconclusive, fail, error.
  bool worse() const;
  bool better() const;  // and not worse
};

// Compares two results of one flight. `tolerance`: the fall of a margin that is still the same.
FlightDifference CompareResults(FlightResult a, FlightResult b, double tolerance);

// Reads both folders of a scenario (verdict.json, trace.csv). Throws std::exception naming the file that
// cannot be read, or why there is no flight.
FlightDifference CompareFlights(const std::filesystem::path& folder_a, const std::filesystem::path& folder_b,
                                double tolerance);

// The flights of a run, or the one of them that was asked for.
struct NamedFlights {
  std::vector<std::string> names;
  bool whole = true;
};

struct FlightPairs {
  std::vector<std::pair<std::size_t, std::size_t>> pairs;  // places in A and in B, in A's order
  std::vector<std::size_t> only_a, only_b;
};

// Pairs flights by name. Two flights that were asked for are a pair whatever they are called; where one was asked
// for, the others of the other run are not missing.
FlightPairs PairFlights(const NamedFlights& a, const NamedFlights& b);

struct RunDifference {
  std::vector<FlightDifference> flights;  // that both have, in A's order
  std::vector<std::string> only_a, only_b;

  std::size_t worse_count() const;
  std::size_t better_count() const;
  // True also when a flight of A is missing in B: no gate is passed by not flying.
  bool worse() const { return worse_count() > 0 || !only_a.empty(); }
};

// Results alone count, so flights need no traces. `whole_a`, `whole_b`: see NamedFlights.
RunDifference CompareRuns(const std::vector<FlightResult>& a, const std::vector<FlightResult>& b,
                          double tolerance, bool whole_a = true, bool whole_b = true);

}  // namespace tiltproof::harness
