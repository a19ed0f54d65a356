#include "harness/score/signals.h"

#include <array>
#include <cmath>
#include <stdexcept>

#include "harness/run/run_log.h"
#include "harness/score/reference_path.h"

namespace tiltproof::harness {
namespace {

std::size_t ColumnIndex(const Trace& trace, std::string_view name) {
  const auto index = trace.Find(name);
  if (!index) throw std::invalid_argument("the trace has no column '" + std::string(name) + "'");
  return *index;
}

std::vector<double> Column(const Trace& trace, std::string_view name) {
  const std::size_t index = ColumnIndex(trace, name);
  std::vector<double> values(trace.row_count());
  for (std::size_t r = 0; r < values.size(); ++r) values[r] = trace.at(r, index);
  return values;
}

// Three columns as points, one a row.
std::vector<Point> Points(const Trace& trace, const std::array<std::string_view, 3>& names) {
  std::array<std::size_t, 3> index{};
  for (std::size_t i = 0; i < 3; ++i) index[i] = ColumnIndex(trace, names[i]);
  std::vector<Point> points(trace.row_count());
  for (std::size_t r = 0; r < points.size(); ++r)
    for (std::size_t i = 0; i < 3; ++i) points[r][i] = trace.at(r, index[i]);
  return points;
}

constexpr std::array<std::string_view, 3> kPosition = {"x_m", "y_m", "z_m"};
constexpr std::array<std::string_view, 3> kReference = {"x_ref_m", "y_ref_m", "z_ref_m"};
constexpr std::array<std::string_view, 3> kVelocity = {"vx_m_s", "vy_m_s", "vz_m_s"};

std::vector<double> PositionError(const Trace& trace) {
  const auto position = Points(trace, kPosition);
  const auto reference = Points(trace, kReference);
  std::vector<double> error(position.size());
  for (std::size_t r = 0; r < error.size(); ++r) error[r] = Distance(position[r], reference[r]);
  return error;
}

std::vector<double> CrossTrackError(const Trace& trace) {
  const auto position = Points(trace, kPosition);
  const ReferencePath path(Points(trace, kReference));
  std::vector<double> error(position.size());
  for (std::size_t r = 0; r < error.size(); ++r) error[r] = path.DistanceTo(position[r]);
  return error;
}

std::vector<double> Speed(const Trace& trace) {
  const auto velocity = Points(trace, kVelocity);
  std::vector<double> speed(velocity.size());
  for (std::size_t r = 0; r < speed.size(); ++r) speed[r] = Distance(velocity[r], Point{});
  return speed;
}

// Body z in the world, Z-Y-X angles, yaw dropped: (sin pitch cos roll, -sin roll, cos pitch cos roll). The
// arc tangent keeps its precision near 0, where an arc cosine loses half the digits.
std::vector<double> Tilt(const Trace& trace) {
  const auto roll = Column(trace, "roll_rad");
  const auto pitch = Column(trace, "pitch_rad");
  std::vector<double> tilt(roll.size());
  for (std::size_t r = 0; r < tilt.size(); ++r) {
    const double horizontal = std::hypot(std::sin(pitch[r]) * std::cos(roll[r]), std::sin(roll[r]));
    tilt[r] = std::atan2(horizontal, std::cos(pitch[r]) * std::cos(roll[r]));
  }
  return tilt;
}

struct ComputedSignal {
  std::string_view name;
  std::vector<double> (*compute)(const Trace&);
};
constexpr std::array<ComputedSignal, 4> kComputedSignals = {{{"position_error_m", PositionError},
                                                             {"cross_track_error_m", CrossTrackError},
                                                             {"speed_m_s", Speed},
                                                             {"tilt_rad", Tilt}}};

}  // namespace

const std::vector<std::string>& SignalNames() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all = TraceColumns();
    for (const auto& signal : kComputedSignals) all.emplace_back(signal.name);
    return all;
  }();
  return names;
}

std::vector<double> ReadSignal(const Trace& trace, std::string_view name) {
  for (const auto& signal : kComputedSignals)
    if (signal.name == name) return signal.compute(trace);
  return Column(trace, name);
}

std::vector<TimeNs> RowTimes(const Trace& trace) {
  const auto seconds = Column(trace, "t_s");
  std::vector<TimeNs> times(seconds.size());
  for (std::size_t r = 0; r < times.size(); ++r) {
    constexpr double kTimeMax_s = 4e9;  // keeps sums of two times inside int64 nanoseconds
    if (!(std::abs(seconds[r]) <= kTimeMax_s))
      throw std::invalid_argument("the trace has no valid time in row " + std::to_string(r));
    times[r] = FromSeconds(seconds[r]);
    if (r > 0 && times[r] <= times[r - 1])
      throw std::invalid_argument("time does not increase in row " + std::to_string(r) + " of the trace");
  }
  return times;
}

double SignalScale(std::string_view name) {
  constexpr double kAngleScale_rad = 0.5;
  return name.ends_with("_rad") ? kAngleScale_rad : 1.0;
}

}  // namespace tiltproof::harness
