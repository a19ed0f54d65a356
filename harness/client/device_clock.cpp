#include "harness/client/device_clock.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string>
#include <utility>
#include <variant>

namespace tiltproof::harness {
namespace {

// No flight lasts that long, and sums of it do not overflow.
constexpr BootTime kFar(kNever / 4);

}  // namespace

void DeviceClock::Drift(BootTime begin, BootTime end, double ppm) {
  spans_.push_back({begin, end, std::llround(ppm * 1e3)});
}

void DeviceClock::Jump(BootTime begin, BootTime end, TimeNs by_ns) {
  offsets_.push_back({begin, end, by_ns});
  offset_sum_ns_ += std::abs(by_ns);
  steps_back_.push_back(by_ns < 0 ? begin : end);
}

std::deque<DeviceEvent> DeviceClock::Follow(const std::vector<faults::DeviceCommand>& commands,
                                            Origin origin) {
  std::deque<DeviceEvent> events;
  const auto add = [&](BootTime at, std::optional<std::size_t> fault, const char* kind, std::string text) {
    events.push_back({.time_ns = at, .fault = fault, .kind = kind, .text = std::move(text)});
  };
  const auto jump_text = [](TimeNs by_ns) {
    return fmt::format("the clock jumps {} by {:.6g} ms", by_ns < 0 ? "back" : "forward",
                       ToSeconds(std::abs(by_ns)) * 1e3);
  };
  for (const faults::DeviceCommand& command : commands) {
    const BootTime begin = origin.ToBootTime(command.at_ns), end = origin.ToBootTime(command.until_ns);
    if (const auto* drift = std::get_if<faults::DriftClock>(&command.action)) {
      Drift(begin, end, drift->ppm);
      add(begin, command.fault, "clock_drift",
          fmt::format("the clock runs {} by {} ppm", drift->ppm < 0 ? "slow" : "fast", std::abs(drift->ppm)));
    } else if (const auto* jump = std::get_if<faults::JumpClock>(&command.action);
               jump != nullptr && jump->by_ns != 0) {
      Jump(begin, end, jump->by_ns);
      add(begin, command.fault, "clock_jump", jump_text(jump->by_ns));
      if (command.until_ns != kNever) add(end, std::nullopt, "clock_jump", jump_text(-jump->by_ns));
    }
  }
  std::stable_sort(events.begin(), events.end(),
                   [](const DeviceEvent& a, const DeviceEvent& b) { return a.time_ns < b.time_ns; });
  return events;
}

TimeNs DeviceClock::Uneven(BootTime time) const {
  TimeNs shown = time.ns();
  for (const Span& span : spans_) {
    const TimeNs overlap = std::min(time, span.end) - span.begin;
    // Seconds and the rest apart: the product of both would overflow.
    if (overlap > 0) shown += overlap / kNsPerS * span.ppb + overlap % kNsPerS * span.ppb / kNsPerS;
  }
  for (const Offset& offset : offsets_)
    if (offset.begin <= time && time < offset.end) shown += offset.by_ns;
  return shown;
}

TimeNs DeviceClock::At(BootTime time) const {
  if (time >= kFar) return kNever;
  TimeNs shown = std::max<TimeNs>(Uneven(time), 0);
  for (const BootTime step : steps_back_)
    if (step <= time) shown = std::max(shown, Uneven(step - 1));
  return shown;
}

BootTime DeviceClock::When(TimeNs shown) const {
  if (spans_.empty() && offsets_.empty()) return BootTime(shown);
  if (shown >= kFar.ns()) return BootTime::Never();
  // Apart from its offsets, the clock never runs at less than half nor at more than twice the true rate.
  TimeNs low = std::max<TimeNs>(shown - offset_sum_ns_, 0) / 2;
  TimeNs high = 2 * (shown + offset_sum_ns_) + 2;
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
