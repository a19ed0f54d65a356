#include "harness/client/device_clock.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <variant>

namespace tiltproof::harness {
namespace {

// No flight lasts that long, and sums of it do not overflow.
constexpr BootTime kFar(kNever / 4);

}  // namespace

void DeviceClock::Drift(BootTime begin, BootTime end, double ppm) {
  spans_.push_back({begin, end, std::llround(ppm * 1e3)});
}

std::deque<DeviceEvent> DeviceClock::Follow(const std::vector<faults::DeviceCommand>& commands,
                                            Origin origin) {
  std::deque<DeviceEvent> begins;
  for (const faults::DeviceCommand& command : commands) {
    const auto* drift = std::get_if<faults::DriftClock>(&command.action);
    if (drift == nullptr) continue;
    const BootTime begin = origin.ToBootTime(command.at_ns);
    Drift(begin, origin.ToBootTime(command.until_ns), drift->ppm);
    begins.push_back({.time_ns = begin,
                      .fault = command.fault,
                      .kind = "clock_drift",
                      .text = fmt::format("the clock runs {} by {} ppm", drift->ppm < 0 ? "slow" : "fast",
                                          std::abs(drift->ppm))});
  }
  return begins;
}

TimeNs DeviceClock::At(BootTime time) const {
  if (time >= kFar) return kNever;
  TimeNs shown = time.ns();
  for (const Span& span : spans_) {
    const TimeNs overlap = std::min(time, span.end) - span.begin;
    // Seconds and the rest apart: the product of both would overflow.
    if (overlap > 0) shown += overlap / kNsPerS * span.ppb + overlap % kNsPerS * span.ppb / kNsPerS;
  }
  return shown;
}

BootTime DeviceClock::When(TimeNs shown) const {
  if (spans_.empty()) return BootTime(shown);
  if (shown >= kFar.ns()) return BootTime::Never();
  // The clock never runs at less than half nor at more than twice the true rate, and never stands still for more
  // than a rounding.
  TimeNs low = shown / 2;
  TimeNs high = 2 * shown + 2;
  while (low < high) {
    const TimeNs middle = low + (high - low) / 2;
    if (At(BootTime(middle)) >= shown) {
      high = middle;
    } else {
      low = middle + 1;
    }
  }
  return BootTime(low);
}

}  // namespace tiltproof::harness
