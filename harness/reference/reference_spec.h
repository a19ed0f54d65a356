// The references of the base station as data: the `reference` of a scenario. trajectory.h evaluates them.
//
// All positions in the world frame; yaw 0 unless stated.
#pragma once

#include <array>
#include <filesystem>
#include <variant>
#include <vector>

namespace tiltproof::harness {

struct HoverReference {
  std::array<double, 3> at_m{};
  double yaw_rad = 0.0;
  friend bool operator==(const HoverReference&, const HoverReference&) = default;
};
// Paper, eq. (1).
struct SpiralReference {
  double turns_count = 3, radius_m = 5, height_m = 10;
  std::array<double, 3> start_m = {2, 0, 0.5};
  double time_s = 60;  // T_f; afterwards the end point is held
  friend bool operator==(const SpiralReference&, const SpiralReference&) = default;
};
struct WaypointsReference {
  std::vector<std::array<double, 3>> points_m;
  double speed_m_s = 1.0;
  friend bool operator==(const WaypointsReference&, const WaypointsReference&) = default;
};
struct CircleReference {
  double radius_m = 5, period_s = 20;
  std::array<double, 3> start_m = {0, 0, 1};
  friend bool operator==(const CircleReference&, const CircleReference&) = default;
};
struct EightReference {
  double width_m = 5, period_s = 20;
  std::array<double, 3> start_m = {0, 0, 1};
  friend bool operator==(const EightReference&, const EightReference&) = default;
};
struct StraightReference {
  std::array<double, 3> from_m{}, to_m{};
  double time_s = 60;
  friend bool operator==(const StraightReference&, const StraightReference&) = default;
};
// CSV: t_s,x_m,y_m,z_m,yaw_rad[,vx_m_s,vy_m_s,vz_m_s]
struct RecordedReference {
  std::filesystem::path file;
  friend bool operator==(const RecordedReference&, const RecordedReference&) = default;
};
struct ReferenceSpec {
  std::variant<HoverReference, SpiralReference, WaypointsReference, CircleReference, EightReference,
               StraightReference, RecordedReference>
      path = SpiralReference{};
  bool velocity = true;  // false: the velocity components are sent as 0
  friend bool operator==(const ReferenceSpec&, const ReferenceSpec&) = default;
};

}  // namespace tiltproof::harness
