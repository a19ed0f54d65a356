// The base station's command at one time: position and velocity, in the world frame.
//
//   const ReferencePoint r = trajectory.At(t);
//   const std::vector<double> row = ToRow(r);   // in the order of ReferenceSignals()
#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "link/signal_table.h"

namespace tiltproof::harness {

struct ReferencePoint {
  std::array<double, 3> position_m{};
  double yaw_rad = 0.0;
  std::array<double, 3> velocity_m_s{};
  friend bool operator==(const ReferencePoint&, const ReferencePoint&) = default;
};

// x_m y_m z_m yaw_rad vx_m_s vy_m_s vz_m_s.
const SignalTable& ReferenceSignals();

std::vector<double> ToRow(const ReferencePoint& point);
// Nullopt for a row of another size.
std::optional<ReferencePoint> FromRow(std::span<const double> row);

}  // namespace tiltproof::harness
