// Where boot time and simulation time are the same numbers, a test can count in one of them.
#pragma once

#include "link/time.h"

namespace tiltproof {

// t = 0 is at power-on.
inline constexpr Origin kOriginAtPowerOn{BootTime()};

}  // namespace tiltproof
