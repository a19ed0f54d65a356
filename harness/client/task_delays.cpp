#include "harness/client/task_delays.h"

#include <algorithm>
#include <variant>

namespace tiltproof::harness {

void TaskDelays::Add(const std::vector<faults::DeviceCommand>& commands, Origin origin) {
  for (const faults::DeviceCommand& command : commands)
    if (const auto* work = std::get_if<faults::DelayTask>(&command.action))
      spans_.push_back(
          {origin.ToBootTime(command.at_ns), origin.ToBootTime(command.until_ns), *work, command.fault});
}

std::optional<TaskDelays::Hold> TaskDelays::At(BootTime now) const {
  std::optional<Hold> longest;
  for (const Span& span : spans_) {
    if (now < span.begin || now >= span.end) continue;
    const TimeNs since = (now - span.begin) % span.work.every_ns;
    if (since >= span.work.delay_ns) continue;
    const BootTime until = std::min(now + (span.work.delay_ns - since), span.end);
    if (!longest || until > longest->until) longest = Hold{until, span.fault};
  }
  return longest;
}

BootTime TaskDelays::NextAfter(BootTime now) const {
  BootTime next = BootTime::Never();
  for (const Span& span : spans_) {
    BootTime begin = span.begin;
    if (now >= begin) begin = now + (span.work.every_ns - (now - span.begin) % span.work.every_ns);
    if (begin < span.end) next = std::min(next, begin);
  }
  return next;
}

}  // namespace tiltproof::harness
