// Finds the SysTicks that a firmware cannot see because this machine had no time for the emulator. A tick that comes while
// the one before is still pending is lost, and a firmware that counts ticks is late by it from then on, for good.
//
//   plugin.lost_ticks.Init(plugin.notes, pthread_self());   // between SysTick and the interrupt controller
#pragma once

#include <pthread.h>
#include <time.h>

#include <algorithm>
#include <cstdint>

#include "harness/emulator/plugin/command.h"
#include "harness/emulator/plugin/qemu_internals.h"
#include "harness/emulator/plugin/realtime_board.h"

namespace tiltproof::qemu {

class LostTicks {
 public:
  // `processor`: the thread that executes the firmware.
  void Init(RealtimeNotes& notes, pthread_t processor) {
    notes_ = &notes;
    void* controller = object_resolve_path("nvic", nullptr);
    void* timer = object_resolve_path("systick-reg-ns", nullptr);
    if (controller == nullptr || timer == nullptr || pthread_getcpuclockid(processor, &processor_clock_) != 0)
      Die("the machine has no SysTick where it should be");
    registers_ = sysbus_mmio_get_region(controller, 0);
    input_ = qdev_get_gpio_in_named(controller, "systick-trigger", 0);
    qdev_connect_gpio_out_named(timer, "sysbus-irq", 0, qemu_allocate_irq(OnTick, this, 0));
  }

 private:
  // QEMU delivers ticks that are overdue all at once: less apart than any firmware's are.
  static constexpr std::int64_t kAtOnceNs = 100'000;

  static void OnTick(void* self, int /*line*/, int level) {
    auto& ticks = *static_cast<LostTicks*>(self);
    if (level != 0) ticks.Look();
    qemu_set_irq(ticks.input_, level);
  }

  // What a firmware loses while it executes, with its interrupts off, is its own fault.
  void Look() {
    constexpr std::uint64_t kControlAndState = 0xD04;  // ICSR (PM0214, section 4.4.3)
    constexpr std::uint64_t kTickPending = 1u << 26;
    std::uint64_t state = 0;
    memory_region_dispatch_read(registers_, kControlAndState, &state, kMemOp32LittleEndian, 0);
    const std::int64_t now = TimeOf(CLOCK_MONOTONIC), run = TimeOf(processor_clock_);
    if ((state & kTickPending) != 0 && 2 * (run - before_run_ns_) < std::max(now - before_ns_, kAtOnceNs))
      notes_->LostTick(before_ns_, now);
    before_ns_ = now;
    before_run_ns_ = run;
  }

  RealtimeNotes* notes_ = nullptr;
  clockid_t processor_clock_{};
  void *registers_ = nullptr, *input_ = nullptr;
  std::int64_t before_ns_ = 0,
               before_run_ns_ = 0;  // the last tick, and the processor's thread had run so long
};

}  // namespace tiltproof::qemu
