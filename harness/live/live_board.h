// Content of a live page: the flight that flies now with its path so far, and the flights before it. The board sends
// each viewer the events that this viewer has not seen.
//
//   LiveBoard board;
//   board.Begin({.name = "hover", .scenario = scenario, .vehicle = vehicle, .shape = {}});
//   board.AddRow(row);                                    // as TraceLayout has it
//   LiveBoard::Seen seen;                                 // one for each viewer
//   const std::string events = board.TakeUpdate(seen);          // what is new for it, as server-sent events
//
// The board's size does not grow with a flight's length: it keeps fewer rows per second of a long flight. A slow
// viewer gets the content at the time of its next read, without what came and went in between.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "harness/report/flight_view.h"
#include "harness/run/trace.h"
#include "harness/scenario/scenario.h"
#include "link/signal_table.h"

namespace tiltproof::harness {

// A flight that can be shown.
struct LivePlan {
  std::string name;
  Scenario scenario;
  VehicleSignals vehicle;
  std::optional<VehicleShape> shape;
};

class LiveBoard {
 public:
  // Spacing of rows in the vehicle's time: some 20 rows a second.
  static constexpr double kSpacing_s = 0.048;
  static constexpr std::size_t kRowsMax = 3'000;
  static constexpr std::size_t kFinishedMax = 20'000, kNotesMax = 200;

  void Begin(const LivePlan& plan);
  // Rows of the flight that has begun, in the order of time: those of its trace, then the states of its clients'
  // supervisors, NaN when they tell none.
  void AddRow(std::span<const double> row);
  std::size_t column_count() const { return column_count_; }
  bool is_flying() const { return flying_; }
  const std::string& flight_name() const { return name_; }
  double time_s() const { return latest_.empty() ? 0.0 : latest_.front(); }
  // A line for the events of the flight.
  void Note(double time_s, std::string_view kind, std::string_view text);
  // A fault was injected into the flight: its scenario's words on it, and from when to when it acts.
  void Inject(std::string_view id, std::string_view type, std::string_view target, double begin_s,
              double end_s);
  // The flight of this name is over; `entry` is its line in the table of flights, as JSON (EntryJson).
  void Finish(const std::string& name, const std::string& entry);
  // The phase, with a text for viewers, as JSON: {"phase": "waiting"|"flying"|"ended", "text": ...}.
  void SetStatus(const std::string& json);

  // All lines of the table, as JSON, for a page that is opened now.
  const std::vector<std::string>& finished() const { return finished_; }

  struct Seen {
    std::uint64_t flight = 0, status = 0, notes = 0;
    double until_s = -std::numeric_limits<double>::infinity();
    std::size_t finished = 0, injected = 0;
    bool over = false;  // that the flight is over
  };
  // Events that the viewer has not seen; empty: none. Beyond `bytes_max` adds no entries, notes or rows.
  std::string TakeUpdate(Seen& seen, std::size_t bytes_max = 65'536) const;

 private:
  void Thin();

  std::uint64_t flight_ = 0;  // the number of flights that have begun
  bool flying_ = false;
  std::string name_, head_;
  Trace trace_;  // the columns of a row, without rows
  std::size_t column_count_ = 0;
  double spacing_s_ = kSpacing_s;
  std::vector<std::string> rows_;  // each as JSON
  std::vector<double> times_s_;    // of rows_
  std::vector<double> latest_;     // the newest row, which may not be in rows_ yet
  std::vector<std::string> injected_;
  std::vector<std::string> notes_;
  std::uint64_t notes_begin_ = 0;  // the number of notes before those
  std::vector<std::string> finished_;
  std::string status_;
  std::uint64_t status_count_ = 0;
};

}  // namespace tiltproof::harness
