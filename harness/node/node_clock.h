// The clock of a node: the machine's monotonic clock, which a fault may make wrong (clock.drift, clock.jump).
#pragma once

#include <chrono>
#include <cstdint>

#include "link/time.h"

namespace tiltproof::harness {

class NodeClock {
 public:
  using Steady = std::chrono::steady_clock;

  BootTime Now() const { return FromSteady(Steady::now()); }
  // The reading of the true clock when this clock shows `time`.
  Steady::time_point ToSteady(BootTime time) const {
    const double since_base = static_cast<double>(time - base_ns_) / rate_;
    return Steady::time_point(std::chrono::nanoseconds(true_base_ns_ + static_cast<TimeNs>(since_base)));
  }

  // From now on it runs `ppm` faster than the true clock. It keeps the time gained before.
  void SetRate(double ppm) {
    const auto now = Steady::now();
    base_ns_ = FromSteady(now);
    true_base_ns_ = now.time_since_epoch().count();
    rate_ = 1.0 + ppm * 1e-6;
  }
  // Moves it forward, or back when negative.
  void Jump(TimeNs by_ns) { base_ns_ += by_ns; }

 private:
  BootTime FromSteady(Steady::time_point t) const {
    const TimeNs since = t.time_since_epoch().count() - true_base_ns_;
    return base_ns_ + static_cast<TimeNs>(static_cast<double>(since) * rate_);
  }

  TimeNs true_base_ns_ = 0;
  BootTime base_ns_;
  double rate_ = 1.0;
};

}  // namespace tiltproof::harness
