// The signals that criteria and metrics read: the numeric columns of the trace, and four that are computed
// from them.
//
//   position_error_m     distance from the vehicle to the reference of the same row
//   cross_track_error_m  smallest distance from the vehicle to the path: the polyline through the reference
//                        points of all rows
//   speed_m_s            magnitude of the velocity
//   tilt_rad             angle between the body's z axis and the world's, [0, pi]
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "harness/run/trace.h"
#include "link/time.h"

namespace tiltproof::harness {

// A flight's trace has one column of this prefix for each fault, 0 or 1: active_<fault id>.
inline constexpr std::string_view kActivePrefix = "active_";

// Trace columns in file order, then the computed signals.
const std::vector<std::string>& SignalNames();

// The signal in every row. NaN where the row does not say (nothing sent yet, a broken file).
// Throws std::invalid_argument when the trace lacks a column that is needed.
std::vector<double> ReadSignal(const Trace& trace, std::string_view name);

// Time of every row, from t_s, to the nanosecond. Throws std::invalid_argument when there is no such column
// or time does not increase from row to row.
std::vector<TimeNs> RowTimes(const Trace& trace);

// What counts as "a lot" of a signal, by the unit in its name: 0.5 for _rad, 1 for everything else. Margins
// are divided by it, so that robustness of different criteria can be compared.
double SignalScale(std::string_view name);

}  // namespace tiltproof::harness
