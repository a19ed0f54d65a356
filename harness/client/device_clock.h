// The clock of a client whose crystal is off (clock.drift): its reading at each instant, and the instant of
// each reading.
//
//   DeviceClock clock;
//   clock.Drift(BootTime(10 * kNsPerS), BootTime(20 * kNsPerS), 100.0);  // runs fast by 100 ppm for ten seconds
//   TimeNs shown = clock.At(BootTime(15 * kNsPerS));   // 15.0005 s
//   BootTime when = clock.When(shown);                 // 15 s
//
// Boot time is the true time, and the clock's reading is a plain number; both begin with 0. Drifts may
// overlap: they add up.
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
  // Adds all drifts among the commands. Returns the events to report when they begin, in order of time.
  std::deque<DeviceEvent> Follow(const std::vector<faults::DeviceCommand>& commands, Origin origin);

  bool drifts() const { return !spans_.empty(); }
  TimeNs At(BootTime time) const;
  // The first nanosecond at which the clock shows `shown` or more.
  BootTime When(TimeNs shown) const;

 private:
  struct Span {
    BootTime begin, end;
    std::int64_t ppb;  // parts per billion, so that everything is an integer
  };
  std::vector<Span> spans_;
};

}  // namespace tiltproof::harness
