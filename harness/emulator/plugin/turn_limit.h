// A limit on the processor time of a turn, so that a turn ends in which the firmware makes each instant expensive.
//
//   limit.Init(cpu, OnLimit);   // called on the processor's thread, between two instructions
//   limit.Begin(run.processor_ns);
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
  void Init(void* cpu, void (*over)()) {
    cpu_ = cpu;
    over_ = over;
    // By a thread of the C library's: the processor's own may be in the middle of an instruction.
    sigevent event{};
    event.sigev_notify = SIGEV_THREAD;
    event.sigev_value.sival_ptr = this;
    event.sigev_notify_function = [](sigval self) {
      auto& limit = *static_cast<TurnLimit*>(self.sival_ptr);
      async_run_on_cpu(limit.cpu_, End, {.host_ptr = &limit});
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

 private:
  static std::int64_t Used() {
    timespec now{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return now.tv_sec * kNsPerSecond + now.tv_nsec;
  }

  // The turn that it was meant for may be over.
  static void End(void* /*cpu*/, RunOnCpuData data) {
    auto& limit = *static_cast<TurnLimit*>(data.host_ptr);
    if (limit.end_ns_ != 0 && Used() >= limit.end_ns_) limit.over_();
  }

  void* cpu_ = nullptr;
  void (*over_)() = nullptr;
  timer_t timer_{};
  std::int64_t end_ns_ = 0;  // by the clock of this process's processor time; 0: none
};

}  // namespace tiltproof::qemu
