// The physics engine's library: initialised once per process, its scratch data once per thread. Internal to
// the plant.
#pragma once

namespace tiltproof::plant {

// Each thread must call this before it uses ODE. Throws PlantError.
void InitialiseOde();

}  // namespace tiltproof::plant
