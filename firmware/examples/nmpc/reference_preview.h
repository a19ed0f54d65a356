// The reference of the next seconds, from those that the base station has sent.
//
//   ReferencePreview preview;
//   preview.Add(now_s, reference);                // in each period
//   const auto path = preview.Path(now_s, lengths_s);   // at now, and after each length
//
// The last velocities give the rate at which the level velocity turns and grows. A path that turns at a constant rate,
// like a circle or a spiral, is continued exactly. The growth of the speed ends after 0.5 s, the climb stays.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <deque>
#include <vector>

#include "firmware/signals.h"

namespace tiltproof::nmpc {

struct PathPoint {
  Eigen::Vector3d p_m = Eigen::Vector3d::Zero(), v_m_s = Eigen::Vector3d::Zero();
  double yaw_rad = 0, yaw_rate_rad_s = 0;
};

class ReferencePreview {
 public:
  // The reference in force at the time.
  void Add(double now_s, const Reference& reference);
  // The first point is at `now_s`. One reference or more must have been taken.
  std::vector<PathPoint> Path(double now_s, const std::vector<double>& lengths_s) const;

 private:
  struct Sample {
    double time_s;
    PathPoint point;
  };
  std::deque<Sample> samples_;  // that differ, over the last 0.1 s
};

}  // namespace tiltproof::nmpc
