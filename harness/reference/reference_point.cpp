#include "harness/reference/reference_point.h"

#include <algorithm>

namespace tiltproof::harness {

const SignalTable& ReferenceSignals() {
  static const SignalTable signals(
      {SignalNamed("x_m", SignalFrame::kWorld), SignalNamed("y_m", SignalFrame::kWorld),
       SignalNamed("z_m", SignalFrame::kWorld), SignalNamed("yaw_rad", SignalFrame::kEuler),
       SignalNamed("vx_m_s", SignalFrame::kWorld), SignalNamed("vy_m_s", SignalFrame::kWorld),
       SignalNamed("vz_m_s", SignalFrame::kWorld)});
  return signals;
}

std::vector<double> ToRow(const ReferencePoint& point) {
  std::vector<double> row(point.position_m.begin(), point.position_m.end());
  row.push_back(point.yaw_rad);
  row.insert(row.end(), point.velocity_m_s.begin(), point.velocity_m_s.end());
  return row;
}

std::optional<ReferencePoint> FromRow(std::span<const double> row) {
  if (row.size() != ReferenceSignals().size()) return std::nullopt;
  ReferencePoint point;
  std::copy_n(row.begin(), 3, point.position_m.begin());
  point.yaw_rad = row[3];
  std::copy_n(row.begin() + 4, 3, point.velocity_m_s.begin());
  return point;
}

}  // namespace tiltproof::harness
