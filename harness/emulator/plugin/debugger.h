// Keeps a flight the same when a debugger stops the processor: at a breakpoint, after a step, or at any time.
//
//   debugger.Init(plugin.cpu);   // in lockstep, on the processor's thread
//
// QEMU 7.2 changes the flight in three ways, and each has its remedy here. It takes a processor that has just stopped for
// one that sleeps, and moves virtual time on to the next timer. A sleep that a stop has interrupted would go on by QEMU's
// own way, which runs the SysTick twice. Interrupts and timers are off during a step.
#pragma once

#include <cstdint>
#include <cstring>
#include <utility>

#include "harness/emulator/plugin/command.h"
#include "harness/emulator/plugin/qemu_internals.h"
#include "harness/emulator/plugin/sleep.h"

namespace tiltproof::qemu {

class Debugger {
 public:
  void Init(void* cpu) {
    cpu_ = static_cast<std::uint8_t*>(cpu);
    TestStepFlags();
    before_work_.notify = BeforeMainLoopWork;
    main_loop_poll_add_notifier(&before_work_);
    qemu_add_vm_change_state_handler(OnMachineState, this);
  }

 private:
  static constexpr std::int32_t kStep = 1;  // SSTEP_ENABLE, without SSTEP_NOIRQ and SSTEP_NOTIMER

  std::int32_t StepFlags() const {
    std::int32_t flags = 0;
    std::memcpy(&flags, cpu_ + kSingleStepOffset, sizeof(flags));
    return flags;
  }
  void TestStepFlags() {
    const std::int32_t before = StepFlags();
    cpu_single_step(cpu_, kStep);
    const bool is_there = StepFlags() == kStep;
    cpu_single_step(cpu_, before);
    if (!is_there || StepFlags() != before)
      Die("the flag of a step is not where it should be: another build of QEMU 7.2?");
  }

  // QEMU's main thread is about to look at the clock, and only then at why the processor has stopped. The clock is on
  // again when the processor runs again.
  static void BeforeMainLoopWork(Notifier* /*self*/, void* /*data*/);

  // The machine is about to run, or has stopped. Its processor's thread has not begun to run it.
  static void OnMachineState(void* self, bool running, int /*state*/) {
    auto& debugger = *static_cast<Debugger*>(self);
    if (running && !std::exchange(debugger.resumes_, true)) async_run_on_cpu(debugger.cpu_, ResumeWork, {});
  }
  static void ResumeWork(void* cpu, RunOnCpuData data);

  std::uint8_t* cpu_ = nullptr;
  Notifier before_work_{};
  bool resumes_ = false;  // ResumeWork is under way
};

inline Debugger& debugger = *new Debugger;

inline void Debugger::BeforeMainLoopWork(Notifier* /*self*/, void* /*data*/) {
  if (cpu_is_stopped(debugger.cpu_)) qemu_clock_enable(kClockVirtual, false);
}

inline void Debugger::ResumeWork(void* cpu, RunOnCpuData data) {
  // QEMU has work of its own at that time, and a processor with work does not sleep.
  if (!cpu_work_list_empty(cpu)) return async_run_on_cpu(cpu, ResumeWork, data);
  debugger.resumes_ = false;
  if (debugger.StepFlags() != 0) cpu_single_step(cpu, kStep);
  SleepOnWork(cpu, data);
}

}  // namespace tiltproof::qemu
