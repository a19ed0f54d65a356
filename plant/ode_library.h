// The physics engine's library: begun once a process, with its scratch data once a thread. Internal to the plant.
#pragma once

namespace tiltproof::plant {

// To be called by each thread before it uses ODE. Throws PlantError.
void InitialiseOde();

}  // namespace tiltproof::plant
