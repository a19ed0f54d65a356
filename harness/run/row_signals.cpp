#include "harness/run/row_signals.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "harness/formula/formula.h"

namespace tiltproof::harness {
namespace {

Point PointAt(std::span<const double> values, std::size_t first) {
  return {values[first], values[first + 1], values[first + 2]};
}

double PositionError(std::span<const double> values) {
  return Distance(PointAt(values, 0), PointAt(values, 3));
}
double Speed(std::span<const double> values) { return Distance(PointAt(values, 0), Point{}); }

// Body z in the world, Z-Y-X angles, yaw dropped: (sin pitch cos roll, -sin roll, cos pitch cos roll). The
// arc tangent keeps its precision near 0, where an arc cosine loses half the digits.
double Tilt(std::span<const double> values) {
  const double roll = values[0], pitch = values[1];
  const double horizontal = std::hypot(std::sin(pitch) * std::cos(roll), std::sin(roll));
  return std::atan2(horizontal, std::cos(pitch) * std::cos(roll));
}

double HeadingError(std::span<const double> values) {
  const double error_rad = std::remainder(values[0] - values[1], 2 * std::numbers::pi);
  return error_rad <= -std::numbers::pi ? std::numbers::pi : error_rad;
}

double Never(std::span<const double>) { return 0; }

struct ComputedSignal {
  std::string_view name;
  std::vector<std::string_view> columns;
  double (*compute)(std::span<const double>);  // null: with the path
};

const std::array<ComputedSignal, 6>& ComputedSignals() {
  static const std::array<ComputedSignal, 6> signals = {
      {{"position_error_m", {"x_m", "y_m", "z_m", "x_ref_m", "y_ref_m", "z_ref_m"}, PositionError},
       {kCrossTrackError, {"x_m", "y_m", "z_m"}, nullptr},
       {"speed_m_s", {"vx_m_s", "vy_m_s", "vz_m_s"}, Speed},
       {"tilt_rad", {"roll_rad", "pitch_rad"}, Tilt},
       {"heading_error_rad", {"yaw_rad", "yaw_ref_rad"}, HeadingError},
       // A column of its own where the ground carries the vehicle.
       {"on_ground", {}, Never}}};
  return signals;
}

}  // namespace

std::vector<std::string> SignalNames(std::span<const std::string> columns) {
  std::vector<std::string> names;
  for (const std::string& column : columns)
    if (!column.starts_with(stl::kActivePrefix)) names.push_back(column);
  for (const ComputedSignal& signal : ComputedSignals())
    if (std::find(names.begin(), names.end(), signal.name) == names.end()) names.emplace_back(signal.name);
  return names;
}

std::vector<std::size_t> ColumnsNamed(std::span<const std::string> columns,
                                      std::span<const std::string_view> names) {
  std::vector<std::size_t> indices;
  for (const std::string_view name : names) {
    const auto found = std::find(columns.begin(), columns.end(), name);
    if (found == columns.end())
      throw std::invalid_argument("the trace has no column '" + std::string(name) + "'");
    indices.push_back(static_cast<std::size_t>(found - columns.begin()));
  }
  return indices;
}

RowSignal::RowSignal(std::span<const std::string> columns, std::string_view name, const ReferencePath* path) {
  const bool is_column = std::find(columns.begin(), columns.end(), name) != columns.end();
  for (const ComputedSignal& signal : ComputedSignals()) {
    if (signal.name != name || is_column) continue;
    columns_ = ColumnsNamed(columns, signal.columns);
    compute_ = signal.compute;
    if (compute_ == nullptr) path_ = path;
    return;
  }
  columns_ = ColumnsNamed(columns, std::array{name});
}

double RowSignal::At(std::span<const double> row) const {
  std::array<double, 6> values{};
  for (std::size_t i = 0; i < columns_.size(); ++i) values[i] = row[columns_[i]];
  if (path_ != nullptr) return path_->DistanceTo(PointAt(values, 0));
  return compute_ == nullptr ? values[0] : compute_(values);
}

}  // namespace tiltproof::harness
