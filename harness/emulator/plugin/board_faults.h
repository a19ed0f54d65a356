// Faults' effects on the board: it stands still, is reset, or bits of its memory flip, each at its virtual nanosecond.
//
//   plugin.stall_timer.Init(OnStallTimer, nullptr);
#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "harness/emulator/plugin/plugin_state.h"
#include "harness/emulator/plugin/processor.h"
#include "harness/emulator/plugin/qemu_internals.h"
#include "harness/emulator/plugin/sleep.h"
#include "harness/emulator/plugin/stack_watch.h"

namespace tiltproof::qemu {

// Time passes, and the processor does nothing: the counter is moved on from timer to timer, until the stall ends.
inline void StallWork(void* cpu, RunOnCpuData data) {
  // A reset that has been asked for comes first, at this very instant.
  if (plugin.pending_cause != ResetCause::kNone) return async_run_on_cpu(cpu, StallWork, data);
  const std::int64_t now = plugin.last_slept_ns = Now();
  if (!plugin.hangs && now >= plugin.stalled_until) {
    plugin.holding = false;
    SendEvent(EventKind::kStallEnds, 0);
    // It may have slept before.
    return async_run_on_cpu(cpu, SleepWork, {});
  }
  std::int64_t step = qemu_clock_deadline_ns_all(kClockVirtual, kAnyAttribute);
  if (!plugin.hangs && (step < 0 || step > plugin.stalled_until - now)) step = plugin.stalled_until - now;
  Advance(step);
  // Before the timers: one of them may reset the processor and begin a stall of its own.
  async_run_on_cpu(cpu, StallWork, data);
  qemu_clock_run_timers(kClockVirtual);
}

inline void HoldUntil(std::int64_t until) {
  if (until == Stall::kNever) {
    plugin.hangs = true;
  } else {
    plugin.stalled_until = std::max(plugin.stalled_until, until);
  }
  if (!std::exchange(plugin.holding, true)) async_run_on_cpu(plugin.cpu, StallWork, {});
}

// The machine is being reset.
inline void OnReset(void* /*opaque*/) {
  const ResetCause cause = std::exchange(plugin.pending_cause, ResetCause::kNone);
  plugin.hangs = false;
  plugin.chip.Reset(cause);
  if (!plugin.arguments.realtime) SendEvent(EventKind::kReset, static_cast<std::uint32_t>(cause));
}

// On the processor's own thread: it has executed nothing since the reset was asked for. QEMU's main thread, whose
// business it is otherwise, comes some time later, and how much later in virtual time depends on the machine.
inline void ResetWork(void* /*cpu*/, RunOnCpuData /*data*/) {
  stack_watch.Look();
  qemu_system_reset(kCauseSystemReset);
}

inline void Reset(ResetCause cause) {
  if (std::exchange(plugin.pending_cause, cause) != ResetCause::kNone) return;
  if (plugin.arguments.realtime) return qemu_system_reset_request(kCauseGuestReset);
  async_run_on_cpu(plugin.cpu, ResetWork, {});
}

// Between two instructions, right before the reset. An image that resets itself for ever would fill the socket's memory.
inline void TellLastWords(void* cpu, RunOnCpuData /*data*/) {
  Send(Kind::kLastWords, LastWordsOf(cpu));
  if (++plugin.turn_resets_count > kResetsPerTurnMax) plugin.end_turn();
}

inline void ResetByItself(ResetCause cause) {
  if (plugin.pending_cause == ResetCause::kNone && !plugin.arguments.realtime)
    async_run_on_cpu(plugin.cpu, TellLastWords, {});
  Reset(cause);
}

inline void OnWatchdog() { ResetByItself(ResetCause::kWatchdog); }

// The firmware has set SYSRESETREQ (PM0214, section 4.4.5).
inline void OnResetRequest(void* /*opaque*/, int /*line*/, int level) {
  if (level != 0 && plugin.pending_cause == ResetCause::kNone) ResetByItself(ResetCause::kSoftware);
}

inline void OnStallTimer(void* /*opaque*/) {
  plugin.stall = plugin.stalls.front();
  plugin.stalls.pop_front();
  if (!plugin.stalls.empty()) plugin.stall_timer.Set(plugin.stalls.front().begin_ns);
  SendEvent(EventKind::kStallBegins, plugin.stall.fault);
  if (plugin.stall.reset != ResetCause::kNone) Reset(plugin.stall.reset);
  HoldUntil(plugin.stall.end_ns);
}

// True if an interrupt is pending, also where the task has switched interrupts off (PM0214, section 4.4.3).
inline bool InterruptIsPending() {
  constexpr std::uint32_t kIcsr = 0xE000'ED04, kVectPending = 0x1FF << 12;
  std::uint32_t icsr = 0;
  ReadAsProcessor(plugin.cpu, kIcsr, &icsr, sizeof(icsr));
  return (icsr & kVectPending) != 0;
}

// Other work has the processor: as StallWork, but the processor takes interrupts. It comes back here when their handlers
// return, before the next instruction of the task. An interrupt that the task has switched off makes the task go on,
// block by block, until it switches interrupts on.
inline void HoldTaskWork(void* cpu, RunOnCpuData data) {
  // Another fault that holds the processor comes first.
  if (plugin.holding || plugin.pending_cause != ResetCause::kNone)
    return async_run_on_cpu(cpu, HoldTaskWork, data);
  const std::int64_t now = plugin.last_slept_ns = Now();
  if (now >= plugin.task_held_until) {
    plugin.holding_task = false;
    return async_run_on_cpu(cpu, SleepWork, {});
  }
  void* nvic = plugin.interrupt_controller;
  const bool in_handler = armv7m_nvic_raw_execution_priority(nvic) != kNoHandler;
  if (in_handler || InterruptIsPending()) {
    plugin.task_may_return = true;
    plugin.task_goes_on = !in_handler && !armv7m_nvic_can_take_pending_exception(nvic);
    return;
  }
  std::int64_t step = qemu_clock_deadline_ns_all(kClockVirtual, kAnyAttribute);
  if (step < 0 || step > plugin.task_held_until - now) step = plugin.task_held_until - now;
  Advance(step);
  async_run_on_cpu(cpu, HoldTaskWork, data);
  qemu_clock_run_timers(kClockVirtual);
}

// Before the first instruction of each block.
inline void OnBlock(unsigned /*vcpu*/, void* /*opaque*/) {
  if (!plugin.task_may_return ||
      armv7m_nvic_raw_execution_priority(plugin.interrupt_controller) != kNoHandler)
    return;
  if (std::exchange(plugin.task_goes_on, false)) return;
  plugin.task_may_return = false;
  async_run_on_cpu(plugin.cpu, HoldTaskWork, {});
  cpu_loop_exit_restore(plugin.cpu, reinterpret_cast<std::uintptr_t>(__builtin_return_address(0)));
}

inline void ArmDelayTimer() {
  std::erase_if(plugin.delays, [](const DelayTask& delay) { return delay.begin_ns >= delay.end_ns; });
  std::int64_t next = Stall::kNever;
  for (const DelayTask& delay : plugin.delays) next = std::min(next, delay.begin_ns);
  if (next != Stall::kNever) plugin.delay_timer.Set(next);
}

inline void OnDelayTimer(void* /*opaque*/) {
  for (DelayTask& delay : plugin.delays) {
    if (delay.begin_ns > Now()) continue;
    plugin.task_held_until =
        std::max(plugin.task_held_until, std::min(delay.begin_ns + delay.delay_ns, delay.end_ns));
    delay.begin_ns += delay.every_ns;
    SendEvent(EventKind::kTaskDelayed, delay.fault);
  }
  ArmDelayTimer();
  if (!std::exchange(plugin.holding_task, true)) async_run_on_cpu(plugin.cpu, HoldTaskWork, {});
}

// Blocks that are translated already do not call OnBlock yet.
inline void AddDelay(const DelayTask& delay) {
  plugin.delays.push_back(delay);
  ArmDelayTimer();
  if (!std::exchange(plugin.watches_blocks, true)) tb_flush(plugin.cpu);
}

inline void OnFlipTimer(void* /*opaque*/) {
  const FlipBits flips = plugin.flips.front();
  plugin.flips.pop_front();
  if (!plugin.flips.empty()) plugin.flip_timer.Set(plugin.flips.front().at_ns);
  for (std::uint32_t i = 0; i < flips.count; ++i) {
    std::uint8_t before = 0;
    cpu_physical_memory_rw(flips.bits[i].address, &before, 1, false);
    std::uint8_t after = before ^ static_cast<std::uint8_t>(1u << flips.bits[i].bit);
    cpu_physical_memory_rw(flips.bits[i].address, &after, 1, true);
    SendEvent(EventKind::kBitFlipped, flips.fault, flips.bits[i].address, before, after);
  }
}

inline void StopWork(void* /*cpu*/, RunOnCpuData /*data*/) { vm_stop(kRunStatePaused); }

// The processor's thread stops between two instructions. QEMU's main thread runs a timer that is due when the debugger lets
// the processor go on, and must not stop the machine from within.
inline void OnBreakTimer(void* /*opaque*/) {
  if (pthread_equal(pthread_self(), plugin.cpu_thread) != 0)
    StopWork(plugin.cpu, {});
  else
    async_run_on_cpu(plugin.cpu, StopWork, {});
}

}  // namespace tiltproof::qemu
