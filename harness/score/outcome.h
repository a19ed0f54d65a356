// The effect of the faults on a flight, in one word. It follows only from the flight, so scripts need not
// parse messages.
#pragma once

#include <cstdint>
#include <string_view>

#include "harness/run/run_log.h"
#include "harness/score/score.h"

namespace tiltproof::harness {

// In this order: a flight belongs to the first class that fits.
enum class Outcome : std::uint8_t {
  kError,       // the harness failed: nothing is known
  kCrashed,     // the firmware crashed, or its process or port went away
  kHung,        // a call into it did not return, or it sent no request for the last kSilentNs
  kFailed,      // the flight's verdict is fail
  kDetected,    // the firmware restarted, or entered its fail-safe state
  kDegraded,    // it follows the path, but kDegradedRatio times worse than before the first fault
  kUnaffected,  // none of these
};
std::string_view Name(Outcome outcome);
constexpr Outcome LastOf(Outcome) { return Outcome::kUnaffected; }

inline constexpr TimeNs kSilentNs = kNsPerS / 2;
inline constexpr double kDegradedRatio = 1.5;

Outcome OutcomeOf(const RunLog& log, const Score& score);

}  // namespace tiltproof::harness
