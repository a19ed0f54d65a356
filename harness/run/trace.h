// The trace of a flight: one row per control period of simulation time, and the definition of its columns.
//
//   const TraceLayout layout(vehicle, scenario);       // the only place that knows their order
//   Trace trace(layout.columns);
//   plant.State(trace.AppendRow().subspan(layout.states, vehicle.states.size()));
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "harness/scenario/scenario.h"
#include "link/signal_table.h"

namespace tiltproof::harness {

// The columns of a flight's trace, in file order, and where each group of them begins:
//
//   t_s, states, inputs in force, reference (x_ref_m y_ref_m z_ref_m yaw_ref_rad), readings of the sensors in the
//   vehicle's file, before faults (VehicleSignals::measured), sensed_<sensor>,
//   commanded_<input>, on_ground (0 or 1; only where the ground carries the vehicle), faults_active_count, link counters (LineCounts, three each), active_<fault id> (0 or 1),
//   watch_<variable>
//
// When the flight is over, supervisor_state follows, if the client tells one (harness/run/supervisor_states.h).
//
// With several clients, the columns of one client come once per client, client by client, and contain its id
// (sensed_a_x_m, commanded_a_f_r_n, to_plant_a_frames_sent_count). After commanded_... follows
// arbiter_selected: the place, from 0, of the client whose actuators are in force.
struct TraceLayout {
  TraceLayout(const VehicleSignals& vehicle, const Scenario& scenario);

  SignalTable columns;
  std::size_t states = 0, inputs = 0, reference = 0, measured = 0, sensed = 0, commanded = 0;
  std::optional<std::size_t> arbiter_selected, on_ground;
  std::size_t faults_active_count = 0, link_counters = 0, active = 0, watch = 0;
};

class Trace {
 public:
  Trace() = default;
  explicit Trace(const SignalTable& columns);
  // Columns known only by their names: those of a file.
  explicit Trace(std::vector<std::string> columns);

  const std::vector<std::string>& columns() const { return columns_; }
  // Scale of margins in this column, see Signal.
  double scale(std::size_t column) const { return scales_[column]; }
  std::size_t row_count() const { return columns_.empty() ? 0 : values_.size() / columns_.size(); }
  std::span<const double> row(std::size_t r) const {
    return std::span(values_).subspan(r * columns_.size(), columns_.size());
  }
  // Index of a column; nullopt when there is none of that name.
  std::optional<std::size_t> Find(std::string_view column) const;
  double at(std::size_t r, std::size_t column) const { return values_[r * columns_.size() + column]; }

  void Reserve(std::size_t rows) { values_.reserve(rows * columns_.size()); }
  // Appends a row, one value per column, NaN allowed; the span stays valid until the next call.
  std::span<double> AppendRow();
  std::span<double> mutable_row(std::size_t r) {
    return std::span(values_).subspan(r * columns_.size(), columns_.size());
  }
  // Puts a column with one value for each row in that place, or behind the others.
  void InsertColumn(std::size_t place, std::string name, std::span<const double> values);
  void AppendColumn(std::string name, std::span<const double> values) {
    InsertColumn(columns_.size(), std::move(name), values);
  }
  // Appends whole rows, one after the other.
  void AppendRows(std::vector<double>&& rows);

 private:
  std::vector<std::string> columns_;
  std::vector<double> scales_;
  std::vector<double> values_;
};

// The vehicle's own columns of a trace, by their indices. The columns before the reference are states and
// inputs; an input also has a column with the commanded value. Those after it are readings of sensors.
struct VehicleColumns {
  std::vector<std::size_t> states, inputs, measured;
};
VehicleColumns FindVehicleColumns(const Trace& trace);

// 16 hexadecimal digits: FNV-1a over the column names and the bits of every value.
std::string TraceHash(const Trace& trace);

}  // namespace tiltproof::harness
