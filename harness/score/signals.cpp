#include "harness/score/signals.h"

#include <array>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <string>

#include "harness/reference/reference_path.h"

namespace tiltproof::harness {
namespace {

// Through the reference of every row.
ReferencePath FlownReference(const Trace& trace) {
  constexpr std::array<std::string_view, 3> kReference = {"x_ref_m", "y_ref_m", "z_ref_m"};
  const auto columns = ColumnsNamed(trace.columns(), kReference);
  std::vector<Point> points(trace.row_count());
  for (std::size_t r = 0; r < points.size(); ++r)
    for (std::size_t i = 0; i < 3; ++i) points[r][i] = trace.at(r, columns[i]);
  return ReferencePath(points);
}

}  // namespace

std::vector<double> ReadSignal(const Trace& trace, std::string_view name) {
  std::optional<ReferencePath> path;
  if (name == kCrossTrackError) path.emplace(FlownReference(trace));
  const RowSignal signal(trace.columns(), name, path ? &*path : nullptr);
  std::vector<double> values(trace.row_count());
  for (std::size_t r = 0; r < values.size(); ++r) values[r] = signal.At(trace.row(r));
  return values;
}

std::vector<TimeNs> RowTimes(const Trace& trace) {
  const auto seconds = ReadSignal(trace, "t_s");
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

double SignalScale(const Trace& trace, std::string_view name) {
  if (const auto column = trace.Find(name)) return trace.scale(*column);
  return SignalNamed(std::string(name), SignalFrame::kNone).scale;
}

}  // namespace tiltproof::harness
