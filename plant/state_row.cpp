#include "plant/state_row.h"

#include <Eigen/Geometry>
#include <cmath>

#include "link/check.h"

namespace tiltproof::plant {

using Eigen::Matrix3d;
using Eigen::Vector3d;

Vector3d VectorAt(std::span<const double> row, std::size_t first) {
  CheckPart(first, 3, row.size(), "a vector is inside its row");
  return {row[first], row[first + 1], row[first + 2]};
}

void SetVector(std::span<double> row, std::size_t first, const Vector3d& v) {
  CheckPart(first, 3, row.size(), "a vector is inside its row");
  for (std::size_t i = 0; i < 3; ++i) row[first + i] = v[static_cast<Eigen::Index>(i)];
}

Matrix3d FromEuler(double roll, double pitch, double yaw) {
  return (Eigen::AngleAxisd(yaw, Vector3d::UnitZ()) * Eigen::AngleAxisd(pitch, Vector3d::UnitY()) *
          Eigen::AngleAxisd(roll, Vector3d::UnitX()))
      .toRotationMatrix();
}

void ExpressRates(RatesFrame frame, const StateLayout& at, std::span<double> state) {
  if (frame == RatesFrame::kWorld) return;
  const Vector3d angles = VectorAt(state, at.attitude);
  Vector3d w = FromEuler(angles[0], angles[1], angles[2]).transpose() * VectorAt(state, at.rates);
  if (frame == RatesFrame::kEuler) {
    const double sin_roll = std::sin(angles[0]), cos_roll = std::cos(angles[0]);
    const double yaw_rate = (w.y() * sin_roll + w.z() * cos_roll) / std::cos(angles[1]);
    w = Vector3d(w.x() + yaw_rate * std::sin(angles[1]), w.y() * cos_roll - w.z() * sin_roll, yaw_rate);
  }
  SetVector(state, at.rates, w);
}

}  // namespace tiltproof::plant
