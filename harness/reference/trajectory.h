// The position that the base station commands: r(t), from the `reference` of a scenario. Pure: the same time
// gives the same answer.
//
//   Trajectory trajectory(scenario.reference);
//   ReferencePoint r = trajectory.At(12 * kNsPerMs);
//
// Before t = 0 the vehicle waits at the start; after its end a reference keeps its end point. Both have
// velocity zero.
#pragma once

#include <array>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include "harness/reference/reference_point.h"
#include "harness/reference/reference_spec.h"
#include "link/time.h"

namespace tiltproof::harness {

// A reference that cannot be flown: an unreadable or malformed recorded file ("file:line: message"), no
// waypoint, ...
struct ReferenceError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// Positions and velocities in the world frame (m, m/s), yaw in rad.
class Trajectory {
 public:
  // Reads the file of a recorded reference. Throws ReferenceError.
  explicit Trajectory(const ReferenceSpec& spec);

  // Velocities are the derivatives of the position, or 0 when the reference has `velocity: false`.
  ReferencePoint At(TimeNs time_ns) const;

  // Position at t = 0.
  std::array<double, 3> Start() const;

  // When a recorded reference begins to move; 0 for the others.
  double FirstSample_s() const;

 private:
  // Points in time joined by straight lines: those of a waypoints or a recorded reference.
  struct Sample {
    double t_s = 0.0;
    ReferencePoint value;
  };
  struct Polyline {
    std::vector<Sample> samples;  // times do not descend
    bool has_velocity = false;    // recorded along with the position; otherwise the slope of the line
    // Keeps both end points, at rest.
    ReferencePoint At(double t_s) const;
  };
  static Polyline FromWaypoints(const WaypointsReference& waypoints);
  static Polyline ReadRecorded(const std::filesystem::path& file);

  ReferenceSpec spec_;
  Polyline polyline_;
};

}  // namespace tiltproof::harness
