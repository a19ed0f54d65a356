// Advances virtual time while the processor executes nothing: when the firmware sleeps.
//
//   async_run_on_cpu(cpu, SleepWork, {});         // it has executed WFI
//   async_run_on_cpu(cpu, WaitForEventWork, {});  // or WFE
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>

#include "harness/emulator/plugin/command.h"
#include "harness/emulator/plugin/parts.h"
#include "harness/emulator/plugin/plugin_state.h"
#include "harness/emulator/plugin/qemu_internals.h"

namespace tiltproof::qemu {

// Virtual time passes although no instruction is executed. QEMU's own way, icount_start_warp_timer(), wakes its main
// thread each time, which costs more than all else.
inline void Advance(std::int64_t step) {
  const std::int64_t now = Now();
  std::int64_t bias = 0;
  std::memcpy(&bias, timers_state + kIcountBiasOffset, sizeof(bias));
  bias += step;
  std::memcpy(timers_state + kIcountBiasOffset, &bias, sizeof(bias));
  if (Now() != now + step) Die("the virtual clock cannot be moved on: another build of QEMU 7.2?");
}

// The processor sleeps: on to the next timer, again and again until an interrupt wakes it. QEMU would do so by
// itself with sleep=off, but 7.2 then runs the SysTick twice.
inline void SleepWork(void* cpu, RunOnCpuData data) {
  plugin.last_slept_ns = Now();
  // QEMU takes it for idle then.
  if (cpu_is_stopped(cpu)) return;
  const std::int64_t next = qemu_clock_deadline_ns_all(kClockVirtual, kAnyAttribute);
  if (!all_cpu_threads_idle() || next < 0) return;
  plugin.turn_sleep.Sleeps(Now());
  Advance(next);
  async_run_on_cpu(cpu, SleepWork, data);
  qemu_clock_run_timers(kClockVirtual);
}

// The processor waits for an event (WFE). It does not have to wait for one, and QEMU's does not: a loop of WFE computes each
// turn. Here it waits for a microsecond, or until the next timer. What has set the event register is late by that much.
inline void WaitForEventWork(void* /*cpu*/, RunOnCpuData /*data*/) {
  constexpr std::int64_t kWaitNs = 1'000;
  const std::int64_t next = qemu_clock_deadline_ns_all(kClockVirtual, kAnyAttribute);
  Advance(next < 0 ? kWaitNs : std::min(next, kWaitNs));
  qemu_clock_run_timers(kClockVirtual);
}

// Once other work of the processor's thread is done, which keeps a sleep from going on.
inline void SleepOnWork(void* cpu, RunOnCpuData data) {
  if (all_cpu_threads_idle()) SleepWork(cpu, data);
}

}  // namespace tiltproof::qemu
