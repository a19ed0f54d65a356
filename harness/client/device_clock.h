// The clock of a client that is wrong (clock.drift, clock.jump): its reading at each instant, and the instant
// of each reading.
//
//   DeviceClock clock;
//   clock.Drift(BootTime(10 * kNsPerS), BootTime(20 * kNsPerS), 100.0);  // runs fast by 100 ppm for ten seconds
//   TimeNs shown = clock.At(BootTime(15 * kNsPerS));   // 15.0005 s
//   BootTime when = clock.When(shown);                 // 15 s
//
// Boot time is the true time, and the clock's reading is a plain number; both begin with 0. Drifts and jumps may
// overlap: they add up. The reading never decreases: after a jump back it stands still until the clock has
// caught up.
#pragma once

#include <deque>
#include <vector>

#include "faults/device_command.h"
#include "harness/client/client.h"
#include "link/time.h"

namespace tiltproof::harness {

class DeviceClock {
 public:
  // `end` may be Never(); |ppm| at most 10 000.
  void Drift(BootTime begin, BootTime end, double ppm);
  // The clock is `by_ns` ahead from `begin` to `end`; behind when negative.
  void Jump(BootTime begin, BootTime end, TimeNs by_ns);
  // Adds all drifts and jumps among the commands. Returns the events to report, in order of time.
  std::deque<DeviceEvent> Follow(const std::vector<faults::DeviceCommand>& commands, Origin origin);

  bool drifts() const { return !spans_.empty(); }
  // It always shows boot time.
  bool is_true() const { return spans_.empty() && offsets_.empty(); }
  TimeNs At(BootTime time) const;
  // The first nanosecond at which the clock shows `shown` or more.
  BootTime When(TimeNs shown) const;

 private:
  struct Span {
    BootTime begin, end;
    std::int64_t ppb;  // parts per billion, so that everything is an integer
  };
  struct Offset {
    BootTime begin, end;
    TimeNs by_ns;
  };
  // The reading without the rule that it never decreases.
  TimeNs Uneven(BootTime time) const;

  std::vector<Span> spans_;
  std::vector<Offset> offsets_;
  std::vector<BootTime> steps_back_;  // where the uneven reading decreases
  TimeNs offset_sum_ns_ = 0;          // of the offsets' magnitudes
};

}  // namespace tiltproof::harness
