// The signals of a flight, read from one row of its trace: the numeric columns, and six signals that are
// computed from them.
//
//   position_error_m     distance from the vehicle to the reference of the same row
//   cross_track_error_m  smallest distance from the vehicle to the path: the polyline through the reference
//                        points of all rows
//   speed_m_s            magnitude of the velocity
//   tilt_rad             angle between the body's z axis and the world's, [0, pi]
//   heading_error_rad    yaw minus the reference's, the short way round: (-pi, pi]
//   on_ground            1 while the vehicle touches the ground, else 0; always 0 where a touch ends the flight
//
//   const RowSignal tilt(trace.columns(), "tilt_rad");
//   tilt.At(trace.row(r));
//
// Criteria read them from a trace after the flight; conditions of faults read them from each row during it.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "harness/reference/reference_path.h"

namespace tiltproof::harness {

// The names that a formula may use for rows with these columns: the columns in file order, without
// active_<fault id> (they go with the faults), then the computed signals.
std::vector<std::string> SignalNames(std::span<const std::string> columns);

inline constexpr std::string_view kCrossTrackError = "cross_track_error_m";

class RowSignal {
 public:
  // For rows with these columns. `path`: needed only for cross_track_error_m; must outlive it. Throws
  // std::invalid_argument when a column is missing.
  RowSignal(std::span<const std::string> columns, std::string_view name, const ReferencePath* path = nullptr);

  // NaN where the row has no value.
  double At(std::span<const double> row) const;

 private:
  using Compute = double (*)(std::span<const double> values);
  std::vector<std::size_t> columns_;
  Compute compute_ = nullptr;  // null: the column itself
  const ReferencePath* path_ = nullptr;
};

// The indices of these columns. Throws std::invalid_argument when one is missing.
std::vector<std::size_t> ColumnsNamed(std::span<const std::string> columns,
                                      std::span<const std::string_view> names);

}  // namespace tiltproof::harness
