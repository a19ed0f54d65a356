#include "firmware/examples/nmpc/reference_preview.h"

#include <algorithm>
#include <cmath>

namespace tiltproof::nmpc {
namespace {

constexpr double kWindow_s = 0.1;
constexpr double kGrowthTime_s = 0.5;
// Faster changes are jumps of the reference, which say nothing on its future.
constexpr double kAccelerationMax_m_s2 = 10, kTurnMax_rad_s = 5, kYawRateMax_rad_s = 3;
constexpr double kSpeedMin_m_s = 1e-3;

double Wrapped(double angle_rad) { return std::remainder(angle_rad, 2 * M_PI); }

}  // namespace

void ReferencePreview::Add(double now_s, const Reference& reference) {
  PathPoint point;
  point.p_m << reference.x_m, reference.y_m, reference.z_m;
  point.v_m_s << reference.vx_m_s, reference.vy_m_s, reference.vz_m_s;
  point.yaw_rad = reference.yaw_rad;
  const bool is_new = samples_.empty() || samples_.back().point.p_m != point.p_m ||
                      samples_.back().point.v_m_s != point.v_m_s ||
                      samples_.back().point.yaw_rad != point.yaw_rad;
  if (is_new) samples_.push_back({now_s, point});
  while (samples_.size() > 1 && samples_.front().time_s < now_s - kWindow_s) samples_.pop_front();
}

std::vector<PathPoint> ReferencePreview::Path(double now_s, const std::vector<double>& lengths_s) const {
  const Sample &first = samples_.front(), &last = samples_.back();
  const double span_s = last.time_s - first.time_s;
  const Eigen::Vector2d v = last.point.v_m_s.head<2>(), before = first.point.v_m_s.head<2>();
  const double speed = v.norm();
  double turn = 0, growth = 0, yaw_rate = 0;
  if (span_s > 0) {
    yaw_rate = Wrapped(last.point.yaw_rad - first.point.yaw_rad) / span_s;
    if (std::abs(yaw_rate) > kYawRateMax_rad_s) yaw_rate = 0;
    if (speed > kSpeedMin_m_s && before.norm() > kSpeedMin_m_s) {
      turn = std::atan2(before[0] * v[1] - before[1] * v[0], before.dot(v)) / span_s;
      growth = (speed - before.norm()) / span_s;
      if (std::abs(turn) > kTurnMax_rad_s || std::abs(growth) > kAccelerationMax_m_s2) turn = growth = 0;
    }
  }
  std::vector<PathPoint> path = {last.point};
  double since_s = 0;
  const auto advance = [&](double length_s) {
    PathPoint next = path.back();
    // The chord of an arc, with the speed of its middle.
    const double half = 0.5 * turn * length_s, sinc = std::abs(half) > 1e-9 ? std::sin(half) / half : 1;
    const auto speed_at = [&](double time_s) {
      return speed + growth * kGrowthTime_s * (1 - std::exp(-time_s / kGrowthTime_s));
    };
    const auto velocity_at = [&](double time_s) -> Eigen::Vector2d {
      const double c = std::cos(turn * time_s), s = std::sin(turn * time_s);
      const double factor = speed > kSpeedMin_m_s ? std::max(speed_at(time_s), 0.0) / speed : 1;
      return factor * Eigen::Vector2d(c * v[0] - s * v[1], s * v[0] + c * v[1]);
    };
    next.p_m.head<2>() += length_s * sinc * velocity_at(since_s + 0.5 * length_s);
    next.p_m[2] += length_s * last.point.v_m_s[2];
    since_s += length_s;
    next.v_m_s.head<2>() = velocity_at(since_s);
    next.yaw_rad += yaw_rate * length_s;
    next.yaw_rate_rad_s = yaw_rate;
    path.push_back(next);
  };
  // A reference that has ended or stays away holds, as it does for every controller.
  if (const double age_s = now_s - last.time_s; age_s > 0 && age_s < kWindow_s) {
    advance(age_s);
    path.erase(path.begin());
  }
  for (const double length_s : lengths_s) advance(length_s);
  return path;
}

}  // namespace tiltproof::nmpc
