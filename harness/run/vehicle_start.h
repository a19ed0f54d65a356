// The plant of a scenario, as it is before the flight.
//
//   plant::Plant plant(model, PlantOptionsOf(scenario));
//   PlaceAtStart(scenario, plant);
#pragma once

#include "harness/scenario/scenario.h"
#include "plant/plant.h"

namespace tiltproof::harness {

inline plant::PlantOptions PlantOptionsOf(const Scenario& scenario) {
  plant::PlantOptions options{.step_ns = scenario.step_ns};
  if (scenario.solid_ground) options.touch_down_max_m_s = scenario.solid_ground->touch_down_max_m_s;
  return options;
}

inline void PlaceAtStart(const Scenario& scenario, plant::Plant& plant) {
  const std::array<double, 3>& p_m = scenario.initial_position_m;
  if (scenario.initial_on_ground)
    plant.ResetOnGround(p_m[0], p_m[1], scenario.initial_attitude_rad);
  else
    plant.Reset(p_m, scenario.initial_attitude_rad);
}

}  // namespace tiltproof::harness
