// The control period of the protocols that are built in, for tests that count in it.
#pragma once

#include "link/time.h"

namespace tiltproof {

inline constexpr TimeNs kControlPeriodNs = 12 * kNsPerMs;

}  // namespace tiltproof
