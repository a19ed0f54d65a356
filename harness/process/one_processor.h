// Keeps an emulator on one processor of this machine, as long as that is useful.
//
// The threads of its virtual processor and of its devices pass every byte to one another, and otherwise
// sleep. On one processor this is a switch of threads; across two it is an interrupt that wakes an idle
// processor, which takes several times as long. But a firmware that never sleeps would keep the devices off
// that one processor. Then both threads may use all processors.
//
//   OneProcessor processor(pid);   // each of several boards has another one
//   processor.Watch();             // now and then
#pragma once

#include <sched.h>
#include <sys/types.h>

#include <chrono>

namespace tiltproof::harness {

class OneProcessor {
 public:
  // Call it once all threads of the process exist.
  explicit OneProcessor(pid_t pid);

  void Watch();

 private:
  using Clock = std::chrono::steady_clock;
  std::chrono::nanoseconds TimeRun() const;

  pid_t pid_;
  cpu_set_t all_{};
  bool watched_ = false;  // it is on one
  Clock::time_point since_;
  std::chrono::nanoseconds run_{};  // until then
};

}  // namespace tiltproof::harness
