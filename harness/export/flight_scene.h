// A flight in space, as messages of Foxglove in JSON: where the parts of the vehicle are at each row of the trace, and what
// they look like.
//
//   const FlightScene scene(flight.trace, vehicle);
//   mcap.Write(scene_topic, 0, scene.Update());
//   for (const std::string& transform : scene.Transforms(time_ns, row)) mcap.Write(transforms, time_ns, transform);
//
// Frames, each in the one before it: `world` (z up); `body`, the vehicle's main body (x forward, y left, z up, origin as in
// its file); `rotor_<name>` for each rotor, at its centre, with z along its thrust and tilted with its hinge.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "harness/report/flight_view.h"
#include "harness/run/trace.h"
#include "link/time.h"

namespace tiltproof::harness {

class FlightScene {
 public:
  // Shows only the axes of the body and the reference path when there is no vehicle. Both arguments must outlive this.
  FlightScene(const Trace& trace, const std::optional<VehicleShape>& vehicle);

  // foxglove.FrameTransform, one for each frame. A row with a pose that is not finite has none.
  std::vector<std::string> Transforms(TimeNs time_ns, std::span<const double> row) const;
  // foxglove.SceneUpdate, for the whole flight: the reference path in `world`, and each part of the vehicle in its frame.
  std::string Update() const;

 private:
  const Trace& trace_;
  const std::optional<VehicleShape>& vehicle_;
  std::optional<std::array<std::size_t, 6>> pose_;  // columns: position, then roll, pitch, yaw
  std::vector<std::optional<std::size_t>> angles_;  // columns, by rotor; none: it does not tilt
};

}  // namespace tiltproof::harness
