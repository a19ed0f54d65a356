#include "harness/client/computing_time.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <variant>

namespace tiltproof::harness {

void SlowSpans::Add(const std::vector<faults::DeviceCommand>& commands, Origin origin) {
  for (const faults::DeviceCommand& command : commands)
    if (const auto* slow = std::get_if<faults::SlowProcessor>(&command.action))
      spans_.push_back({origin.ToBootTime(command.at_ns), origin.ToBootTime(command.until_ns), slow->factor,
                        command.fault});
}

Computation ComputeOn(const SlowSpans& slow, const TaskDelays& delays, BootTime begin, TimeNs length_ns) {
  constexpr int kChangesMax = 100'000;
  constexpr double kNever_ns = 1e15;  // beyond every flight
  Computation computation{.end = begin, .faults = {}};
  const auto note = [&](std::size_t fault) {
    if (std::find(computation.faults.begin(), computation.faults.end(), fault) == computation.faults.end())
      computation.faults.push_back(fault);
  };
  BootTime& now = computation.end;
  const BootTime never = begin + static_cast<TimeNs>(kNever_ns);
  auto left_ns = static_cast<double>(length_ns);  // on a sound processor
  for (int change = 0; change < kChangesMax && now < never; ++change) {
    if (const auto hold = delays.At(now)) {
      note(hold->fault);
      now = hold->until;
      continue;
    }
    double factor = 1;
    BootTime next = std::min(delays.NextAfter(now), never);
    for (const SlowSpans::Span& span : slow.spans()) {
      if (span.begin > now) next = std::min(next, span.begin);
      if (span.begin > now || span.end <= now) continue;
      next = std::min(next, span.end);
      if (span.factor == 1) continue;
      factor *= span.factor;
      note(span.fault);
    }
    // Rounded first: what is left after exact steps must not wait for the end of a hold.
    const double needed_ns = std::round(left_ns * factor);
    if (needed_ns <= static_cast<double>(next - now)) {
      now += static_cast<TimeNs>(needed_ns);
      return computation;
    }
    left_ns -= static_cast<double>(next - now) / factor;
    now = next;
  }
  now = never;
  return computation;
}

}  // namespace tiltproof::harness
