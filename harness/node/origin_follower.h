// t = 0 by the clock of a node on another host than the plant's: from the simulation time that the plant publishes once a
// period.
//
//   OriginFollower follower;
//   if (follower.Hear(clock.Now(), plant_state.time_ns)) Use(follower.origin());   // it is another one now
#pragma once

#include <algorithm>
#include <cstdlib>

#include "link/time.h"

namespace tiltproof::harness {

class OriginFollower {
 public:
  // Takes a message of that simulation time. True if the origin has changed.
  bool Hear(BootTime now, TimeNs time_ns) {
    // Messages are late, never early: the earliest origin of the last second or two is the best, and a clock that
    // drifts is followed.
    if (now >= window_end_ns_) {
      last_window_ns_ = window_ns_;
      window_ns_ = BootTime::Never();
      window_end_ns_ = now + kNsPerS;
    }
    window_ns_ = std::min(window_ns_, now - time_ns);
    const BootTime best = std::min(window_ns_, last_window_ns_);
    if (origin_.known() && std::abs(best - origin_.boot_time()) < kTolerance) return false;
    origin_ = Origin(best);
    return true;
  }

  const Origin& origin() const { return origin_; }

 private:
  static constexpr TimeNs kTolerance = 100 * kNsPerUs;

  Origin origin_;
  BootTime window_ns_ = BootTime::Never(), last_window_ns_ = BootTime::Never(),
           window_end_ns_ = BootTime::Earliest();
};

}  // namespace tiltproof::harness
