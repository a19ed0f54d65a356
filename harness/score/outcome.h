// What the faults did to a flight, in one word: from the flight alone, so that scripts need no message.
#pragma once

#include <cstdint>
#include <string_view>

#include "harness/run/run_log.h"
#include "harness/score/score.h"

namespace tiltproof::harness {

// In this order: a flight is in the first class that fits.
enum class Outcome : std::uint8_t {
  kError,       // trouble of the harness: nothing is known
  kCrashed,     // the firmware crashed, or its process or port went away
  kHung,        // it did not come back from a call, or sent no request for kSilentNs until the end
  kFailed,      // the flight's verdict is fail
  kDetected,    // the firmware restarted, or entered its fail-safe state
  kDegraded,    // it follows the path, but kDegradedRatio times worse than before the first fault
  kUnaffected,  // none of these
};
std::string_view Name(Outcome outcome);

inline constexpr TimeNs kSilentNs = kNsPerS / 2;
inline constexpr double kDegradedRatio = 1.5;

Outcome OutcomeOf(const RunLog& log, const Score& score);

}  // namespace tiltproof::harness
