#include "harness/process/hang_watch.h"

#include <time.h>

#include <algorithm>

namespace tiltproof::harness {
namespace {

// Long enough for the kernel's ticks of 10 ms to tell how much of it was used.
constexpr TimeNs kJudged = 200 * kNsPerMs;
// Who has used less than this share of it, in percent, has slept.
constexpr TimeNs kBusyPercent = 75;

}  // namespace

void HangWatch::Look(Clock::time_point now, const Sent& sent, bool held) {
  own_ns_ = own_.Look(now);
  const bool begins = spoke_ == Clock::time_point{};
  if (begins || held || sent.main_line != sent_.main_line) {
    spoke_ = begins || held ? now : sent.main_line;
    spoke_own_ns_ = own_ns_;
  }
  if (begins || held || sent.any != sent_.any) {
    active_ = begins || held ? now : sent.any;
    active_own_ns_ = own_ns_;
  }
  sent_ = sent;
  const TimeNs own_ns = own_ns_ - judged_own_ns_;
  if (own_ns < kJudged && !begins) return;
  const TimeNs run_ns = TimeRun() - judged_run_ns_;
  if (100 * run_ns < kBusyPercent * own_ns) {
    // When is not known: at the latest before all that it has run.
    const TimeNs awake_ns = std::min(run_ns, own_ns);
    active_ = std::max(active_, now - std::chrono::nanoseconds(awake_ns));
    active_own_ns_ = std::max(active_own_ns_, own_ns_ - awake_ns);
  }
  judged_own_ns_ = own_ns_;
  judged_run_ns_ += run_ns;
}

TimeNs HangWatch::TimeRun() const {
  clockid_t clock{};
  timespec time{};
  if (clock_getcpuclockid(pid_, &clock) != 0 || clock_gettime(clock, &time) != 0) return 0;
  return time.tv_sec * kNsPerS + time.tv_nsec;
}

}  // namespace tiltproof::harness
