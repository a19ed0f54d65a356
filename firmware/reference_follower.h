// Selects the reference that the build `tolerant` flies: the one received, unless that jumps or stays away.
//
//   ReferenceFollower follower({.x_m = 1, .z_m = 2});   // until one is received
//   follower.BeginPeriod();                        // once per control period
//   follower.Receive({.x_m = 1, .y_m = 1, .z_m = 2});
//   const Reference flown = follower.Flown();      // the bits received, if follower.follows()
//
// A reference jumps if a vehicle cannot fly to it in time from the one before, moved along its velocity. It is flown
// when several in a row agree with it, and then approached at a bounded speed. Meanwhile,
// and when none comes, the last one moves on along its velocity for a bounded time, and then stays.
#pragma once

#include <cstdint>
#include <optional>

#include "firmware/signals.h"

namespace tiltproof::firmware {

class ReferenceFollower {
 public:
  // `stay` is flown until a reference is received, and left at once for the first.
  explicit ReferenceFollower(const Reference& stay) : accepted_(stay) {}

  void BeginPeriod();
  void Receive(const Reference& reference);

  Reference Flown() const;
  bool follows() const { return !Late() && !approaching_; }

 private:
  bool Late() const;
  Reference Extrapolated() const;

  Reference accepted_;
  bool any_received_ = false;
  std::int32_t accepted_age_ = 0;     // periods
  Reference candidate_;               // the last one not accepted
  std::int32_t candidate_age_ = 0;    // periods
  std::int32_t candidate_count_ = 0;  // in a row that agree with each other
  Reference offset_;                  // flown minus accepted, of x, y, z, yaw; shrinks
  bool approaching_ = false;
};

}  // namespace tiltproof::firmware
