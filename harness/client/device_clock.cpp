#include "harness/client/device_clock.h"

#include <algorithm>
#include <cmath>

namespace tiltproof::harness {
namespace {

// No flight lasts that long, and sums of it do not overflow.
constexpr TimeNs kFar = kNever / 4;

}  // namespace

void DeviceClock::Drift(TimeNs begin, TimeNs end, double ppm) {
  spans_.push_back({begin, end, std::llround(ppm * 1e3)});
}

TimeNs DeviceClock::At(TimeNs time) const {
  if (time >= kFar) return kNever;
  TimeNs shown = time;
  for (const Span& span : spans_) {
    const TimeNs overlap = std::min(time, span.end) - span.begin;
    // Seconds and the rest apart: the product of both would overflow.
    if (overlap > 0) shown += overlap / kNsPerS * span.ppb + overlap % kNsPerS * span.ppb / kNsPerS;
  }
  return shown;
}

TimeNs DeviceClock::When(TimeNs shown) const {
  if (spans_.empty()) return shown;
  if (shown >= kFar) return kNever;
  // The clock never runs at less than half nor at more than twice the true rate, and never stands still for more
  // than a rounding.
  TimeNs low = shown / 2;
  TimeNs high = 2 * shown + 2;
  while (low < high) {
    const TimeNs middle = low + (high - low) / 2;
    if (At(middle) >= shown) {
      high = middle;
    } else {
      low = middle + 1;
    }
  }
  return low;
}

}  // namespace tiltproof::harness
