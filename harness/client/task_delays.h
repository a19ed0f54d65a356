// When other work keeps a firmware's task from running (device.task_delay).
//
//   TaskDelays delays;
//   delays.Add(faults::DeviceCommands(scenario.faults, scenario.seed), origin);
//   if (const auto hold = delays.At(now)) wake_ns = hold->until;   // whatever is due at `now` waits until then
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "faults/device_command.h"
#include "link/time.h"

namespace tiltproof::harness {

class TaskDelays {
 public:
  void Add(const std::vector<faults::DeviceCommand>& commands, Origin origin);

  struct Hold {
    BootTime until;
    std::size_t fault;  // its index in the scenario
  };
  // The hold on the task at `now`, the longest of several; nullopt when nothing holds it.
  std::optional<Hold> At(BootTime now) const;
  // The first time after `now` at which a hold may begin; Never() when there is none.
  BootTime NextAfter(BootTime now) const;

 private:
  struct Span {
    BootTime begin, end;
    faults::DelayTask work;
    std::size_t fault;
  };
  std::vector<Span> spans_;
};

}  // namespace tiltproof::harness
