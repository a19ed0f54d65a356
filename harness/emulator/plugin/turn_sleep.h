// Until when a processor that sleeps does so by itself: what it tells the harness at the end of a turn.
//
//   turn_sleep.Begin(Now(), deadline_ns);     // the timers' next, before the turn's own is set
//   turn_sleep.Sleeps(Now());                 // the processor sleeps, and no interrupt is pending
//   turn_sleep.Until(Now());                  // at the end of the turn
//
// Only interrupts wake it, and only timers of the virtual clock raise them. A processor that has slept for a whole turn in
// which no timer was due sleeps on until the next timer.
#pragma once

#include <cstdint>

namespace tiltproof::qemu {

class TurnSleep {
 public:
  // `deadline_ns`: from now on; negative: there is no timer.
  void Begin(std::int64_t now_ns, std::int64_t deadline_ns) {
    begin_ns_ = now_ns;
    timer_ns_ = deadline_ns < 0 ? kNever : now_ns + deadline_ns;
    sleeps_ = false;
  }
  // A processor that sleeps at the beginning of a turn has executed nothing in it: an instruction takes time.
  void Sleeps(std::int64_t now_ns) { sleeps_ = sleeps_ || now_ns == begin_ns_; }
  // `now_ns`: it may act at once.
  std::int64_t Until(std::int64_t now_ns) const { return sleeps_ && timer_ns_ > now_ns ? timer_ns_ : now_ns; }

 private:
  static constexpr std::int64_t kNever = INT64_MAX;

  std::int64_t begin_ns_ = kNever, timer_ns_ = 0;
  bool sleeps_ = false;
};

}  // namespace tiltproof::qemu
