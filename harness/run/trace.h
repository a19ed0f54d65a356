// The trace of a flight: one row every 12 ms of simulation time, columns named as in trace.csv, and the
// signals computed from them.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace tiltproof::harness {

// Columns in file order: t_s, truth (16), inputs in force (4), ideal reference (4), sensed_ (16), commanded_
// (4), faults_active_count, link counters; a flight adds active_<fault id> (0 or 1) for each fault of its
// scenario.
const std::vector<std::string>& TraceColumns();

class Trace {
 public:
  explicit Trace(std::vector<std::string> columns);

  const std::vector<std::string>& columns() const { return columns_; }
  std::size_t row_count() const { return columns_.empty() ? 0 : values_.size() / columns_.size(); }
  std::span<const double> row(std::size_t r) const {
    return std::span(values_).subspan(r * columns_.size(), columns_.size());
  }
  // Index of a column; nullopt when there is none of that name.
  std::optional<std::size_t> Find(std::string_view column) const;
  double at(std::size_t r, std::size_t column) const { return values_[r * columns_.size() + column]; }

  void Reserve(std::size_t rows) { values_.reserve(rows * columns_.size()); }
  // Appends a row of NaN-free or NaN values, one a column; the span stays valid until the next call.
  std::span<double> AppendRow();
  // Appends whole rows, one after the other.
  void AppendRows(std::vector<double>&& rows);

 private:
  std::vector<std::string> columns_;
  std::vector<double> values_;
};

}  // namespace tiltproof::harness
