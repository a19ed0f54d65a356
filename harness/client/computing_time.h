// The end of a computation on a processor that faults slow down (device.slow_cpu) or take away (device.task_delay).
//
//   SlowSpans slow;
//   slow.Add(commands, origin);
//   TaskDelays delays;
//   delays.Add(commands, origin);
//   const BootTime end = ComputeOn(slow, delays, now, 5 * kNsPerMs).end;
#pragma once

#include <cstddef>
#include <vector>

#include "faults/device_command.h"
#include "harness/client/task_delays.h"
#include "link/time.h"

namespace tiltproof::harness {

// When the processor is slow.
class SlowSpans {
 public:
  // Adds those of the commands.
  void Add(const std::vector<faults::DeviceCommand>& commands, Origin origin);

  struct Span {
    BootTime begin, end;
    double factor;      // how many times longer computing takes
    std::size_t fault;  // its index in the scenario
  };
  const std::vector<Span>& spans() const { return spans_; }

 private:
  std::vector<Span> spans_;
};

struct Computation {
  BootTime end;
  std::vector<std::size_t>
      faults;  // that slowed it or held it, each once, in the order in which they began to
};

// `length_ns` > 0 on a sound processor from `begin` on. The end t fulfils
//
//     length = integral from begin to t of s(x) dx,
//     s(x) = 0 while the task is held, else 1 / (product of the factors in force at x),
//
// to the nearest nanosecond. One that changes its speed more than 100 000 times before ends 1e6 s later.
Computation ComputeOn(const SlowSpans& slow, const TaskDelays& delays, BootTime begin, TimeNs length_ns);

}  // namespace tiltproof::harness
