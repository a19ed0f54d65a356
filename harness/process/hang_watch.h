// Measures how long the firmware in an emulator has been silent, and busy. Only time that the emulator has had for
// itself counts (harness/process/own_time.h).
//
//   HangWatch watch(pid);
//   watch.Look(HangWatch::Clock::now(), {.any = last_byte, .main_line = last_byte_there}, held);  // every 50 ms
//   if (watch.busy_ns() > HangWatch::kLimit) ...
//
// The emulator's use of this machine's processors shows sleep of the emulated one: a processor that never sleeps
// uses all time that the emulator gets.
#pragma once

#include <sys/types.h>

#include <chrono>

#include "harness/process/own_time.h"
#include "link/time.h"

namespace tiltproof::harness {

class HangWatch {
 public:
  using Clock = std::chrono::steady_clock;
  // As in lockstep.
  static constexpr TimeNs kLimit = 2 * kNsPerS;

  // When the firmware sent its last byte.
  struct Sent {
    Clock::time_point any, main_line;
  };

  explicit HangWatch(pid_t pid) : pid_(pid), own_(pid) {}

  // `held`: a fault of the scenario keeps the processor from executing.
  void Look(Clock::time_point now, const Sent& sent, bool held);

  // Since it last sent a byte on the main line, or was held.
  TimeNs silent_ns() const { return own_ns_ - spoke_own_ns_; }
  // Since it last slept or sent a byte on any line, or was held.
  TimeNs busy_ns() const { return own_ns_ - active_own_ns_; }
  Clock::time_point spoke() const { return spoke_; }
  Clock::time_point active() const { return active_; }

 private:
  TimeNs TimeRun() const;

  pid_t pid_;
  OwnTime own_;
  TimeNs own_ns_ = 0;
  Sent sent_;
  Clock::time_point spoke_, active_;
  TimeNs spoke_own_ns_ = 0, active_own_ns_ = 0;  // by then
  // The last time that was judged: asleep or not.
  TimeNs judged_own_ns_ = 0, judged_run_ns_ = 0;
};

}  // namespace tiltproof::harness
