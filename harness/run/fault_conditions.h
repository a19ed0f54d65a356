// The conditions of a scenario's faults (`when`), checked in every row of the flight while it is flown.
//
//   FaultConditions conditions(scenario, columns);
//   conditions.Look(t, row, events);   // at each row: what turned true or false in it
//
// A row is checked before anything else happens at its time. Its state and reference are those of that time;
// its inputs, sent values and commanded values are the last ones before it.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "faults/fault_event.h"
#include "harness/formula/condition.h"
#include "harness/reference/reference_path.h"
#include "harness/run/row_signals.h"
#include "harness/scenario/scenario.h"

namespace tiltproof::harness {

// The path through the reference of every row that the flight will have.
ReferencePath PlannedPath(const Scenario& scenario);

class FaultConditions {
 public:
  // `columns`: the columns of the rows. Throws stl::ParseError.
  FaultConditions(const Scenario& scenario, const std::vector<std::string>& columns);
  FaultConditions(const FaultConditions&) = delete;
  FaultConditions& operator=(const FaultConditions&) = delete;

  bool empty() const { return conditions_.empty(); }
  // Appends what has changed since the previous row. Before the first row no condition holds.
  void Look(TimeNs t, std::span<const double> row, std::vector<faults::FaultEvent>& events);

  // The signals that a condition may read: those that the plant knows. Counters of the line and of faults are
  // not among them.
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
  std::vector<Signal> signals_;        // those that conditions read
};

}  // namespace tiltproof::harness
