// A limit on the processor time of a turn, so that a turn ends in which the firmware makes each instant expensive.
//
//   limit.Init(cpu, AtLimit);        // work of the processor's thread, between two instructions
//   limit.Begin(run.processor_ns);
//   if (limit.Exceeded()) Stop();    // in AtLimit: the turn may just have ended, and another one begun
//
// A turn that keeps the limit is not influenced.
#pragma once

#include <csignal>
#include <cstdint>
#include <ctime>

#include "harness/emulator/plugin/command.h"
#include "harness/emulator/plugin/parts.h"
#include "harness/emulator/plugin/qemu_internals.h"

namespace tiltproof::qemu {

class TurnLimit {
 public:
  void Init(void* cpu, void (*at_limit)(void* cpu, RunOnCpuData)) {
    cpu_ = cpu;
    at_limit_ = at_limit;
    // By a thread of the C library's: the processor's own may be in the middle of an instruction.
    sigevent event{};
    event.sigev_notify = SIGEV_THREAD;
    event.sigev_value.sival_ptr = this;
    event.sigev_notify_function = [](sigval self) {
      const auto& limit = *static_cast<const TurnLimit*>(self.sival_ptr);
      async_run_on_cpu(limit.cpu_, limit.at_limit_, {});
    };
    if (timer_create(CLOCK_PROCESS_CPUTIME_ID, &event, &timer_) != 0)
      Die("there is no timer of processor time");
  }

  // 0: no limit.
  void Begin(std::int64_t processor_ns) {
    end_ns_ = processor_ns == 0 ? 0 : Used() + processor_ns;
    itimerspec time{};
    time.it_value = {end_ns_ / kNsPerSecond, end_ns_ % kNsPerSecond};
    timer_settime(timer_, TIMER_ABSTIME, &time, nullptr);
  }

  bool Exceeded() const { return end_ns_ != 0 && Used() >= end_ns_; }

 private:
  static std::int64_t Used() {
    timespec now{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return now.tv_sec * kNsPerSecond + now.tv_nsec;
  }

  void* cpu_ = nullptr;
  void (*at_limit_)(void* cpu, RunOnCpuData) = nullptr;
  timer_t timer_{};
  std::int64_t end_ns_ = 0;  // by the clock of this process's processor time; 0: none
};

}  // namespace tiltproof::qemu
