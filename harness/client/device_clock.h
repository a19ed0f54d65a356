// The clock of a client whose crystal is off (clock.drift): what it shows at each instant, and when it shows that.
//
//   DeviceClock clock;
//   clock.Drift(10 * kNsPerS, 20 * kNsPerS, 100.0);    // runs fast by 100 ppm for ten seconds
//   TimeNs shown = clock.At(15 * kNsPerS);              // 15.0005 s
//   TimeNs when = clock.When(shown);                    // 15 s
//
// Time is the harness's, nanoseconds since power-on; both clocks begin with 0. Drifts may overlap: they add up.
#pragma once

#include <deque>
#include <vector>

#include "faults/device_command.h"
#include "harness/client/client.h"
#include "link/time.h"

namespace tiltproof::harness {

class DeviceClock {
 public:
  // `end` may be kNever; |ppm| at most 10 000.
  void Drift(TimeNs begin, TimeNs end, double ppm);
  // All drifts among the commands, whose times count from `origin`. Returns what is to be told when they begin, in
  // order of time.
  std::deque<DeviceEvent> Follow(const std::vector<faults::DeviceCommand>& commands, TimeNs origin);

  TimeNs At(TimeNs time) const;
  // The first nanosecond at which the clock shows `shown` or more.
  TimeNs When(TimeNs shown) const;

 private:
  struct Span {
    TimeNs begin, end;
    std::int64_t ppb;  // parts per billion, so that all is integer
  };
  std::vector<Span> spans_;
};

}  // namespace tiltproof::harness
