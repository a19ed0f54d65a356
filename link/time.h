// Time is an int64 count of nanoseconds, and is always passed in: nothing below the real-time adapters reads
// a clock.
//
// Simulation time t = 0 is when the server accepts the client's `start` (arrival of its last byte); what
// happened before has negative time. The lockstep conductor counts from the client's power-on instead (boot
// time) and subtracts the offset when it logs.
#pragma once

#include <cstdint>
#include <limits>

namespace tiltproof {

using TimeNs = std::int64_t;

inline constexpr TimeNs kNsPerUs = 1'000;
inline constexpr TimeNs kNsPerMs = 1'000'000;
inline constexpr TimeNs kNsPerS = 1'000'000'000;

// Later than everything; "never" as a wake-up or arrival time.
inline constexpr TimeNs kNever = std::numeric_limits<TimeNs>::max();
// Earlier than everything, power-on included.
inline constexpr TimeNs kPowerOn = std::numeric_limits<TimeNs>::min();

// Nearest nanosecond (half away from zero) of a finite time in seconds, |s| < 9e9.
constexpr TimeNs FromSeconds(double s) {
  const double ns = s * 1e9;
  return static_cast<TimeNs>(ns < 0 ? ns - 0.5 : ns + 0.5);
}
constexpr double ToSeconds(TimeNs t) { return static_cast<double>(t) / 1e9; }

}  // namespace tiltproof
