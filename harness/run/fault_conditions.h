// The conditions of a scenario's faults (`when`), looked at in every row of the flight while it is flown.
//
//   FaultConditions conditions(scenario, columns);
//   conditions.Look(t, row, news);   // at each row: what turned true or false with it
//
// A row is looked at before anything else happens at its time: its state and reference are those of the time, inputs, sent
// and commanded values the last before it.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "faults/news.h"
#include "harness/formula/condition.h"
#include "harness/reference/reference_path.h"
#include "harness/run/row_signals.h"
#include "harness/scenario/scenario.h"

namespace tiltproof::harness {

class FaultConditions {
 public:
  // `columns`: of the rows. Throws stl::ParseError.
  FaultConditions(const Scenario& scenario, const std::vector<std::string>& columns);
  FaultConditions(const FaultConditions&) = delete;
  FaultConditions& operator=(const FaultConditions&) = delete;

  bool empty() const { return conditions_.empty(); }
  // Appends what differs from the row before; before the first, none holds.
  void Look(TimeNs t, std::span<const double> row, std::vector<faults::News>& news);

  // What a condition may read: what the plant knows, so no counters of the line and of faults.
  static std::vector<std::string> SignalNames(std::span<const std::string> columns);

 private:
  struct Entry {
    std::size_t fault;
    stl::Condition condition;
    bool holds = false;
  };
  struct Signal {
    std::string name;
    RowSignal reader;
    double value;
  };

  std::vector<Entry> conditions_;
  std::optional<ReferencePath> path_;  // of cross_track_error_m
  std::vector<Signal> signals_;        // that any condition reads
};

}  // namespace tiltproof::harness
