// Keeps an emulator on one processor of this machine, as long as that serves it.
//
// The thread of its virtual processor and that of its devices hand every byte to one another, and otherwise sleep. On
// one processor such a hand-over is a switch of threads; across two of them it is an interrupt that wakes an idle one,
// which takes several times as long. But a firmware that never sleeps would keep the devices from that one processor:
// then both may use all.
//
//   OneProcessor processor(pid);   // of several boards each has another
//   processor.Watch();             // now and then
#pragma once

#include <sched.h>
#include <sys/types.h>

#include <chrono>

namespace tiltproof::harness {

class OneProcessor {
 public:
  // Once all threads of the process are there.
  explicit OneProcessor(pid_t pid);

  void Watch();

 private:
  using Clock = std::chrono::steady_clock;
  void Allow(const cpu_set_t& processors) const;
  std::chrono::nanoseconds TimeRun() const;

  pid_t pid_;
  cpu_set_t all_{};
  bool watched_ = false;  // it is on one
  Clock::time_point since_;
  std::chrono::nanoseconds run_{};  // until then
};

}  // namespace tiltproof::harness
