// Finds the SysTicks that a firmware cannot see because this machine had no time for the emulator (TickRule). A firmware that
// counts ticks is late by each of them from then on, for good.
//
//   plugin.lost_ticks.Init(plugin.notes, pthread_self());   // between SysTick and the interrupt controller
#pragma once

#include <pthread.h>
#include <time.h>

#include <cstdint>

#include "harness/emulator/plugin/command.h"
#include "harness/emulator/plugin/qemu_internals.h"
#include "harness/emulator/plugin/realtime_board.h"
#include "harness/emulator/plugin/tick_rule.h"

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
    rule_ =
        TickRule({.at_ns = TimeOf(CLOCK_MONOTONIC), .run_ns = TimeOf(processor_clock_), .pending = false});
    registers_ = sysbus_mmio_get_region(controller, 0);
    input_ = qdev_get_gpio_in_named(controller, "systick-trigger", 0);
    qdev_connect_gpio_out_named(timer, "sysbus-irq", 0, qemu_allocate_irq(OnTick, this, 0));
  }

 private:
  static void OnTick(void* self, int /*line*/, int level) {
    auto& ticks = *static_cast<LostTicks*>(self);
    if (level != 0) ticks.Look();
    qemu_set_irq(ticks.input_, level);
  }

  void Look() {
    constexpr std::uint64_t kControlAndState = 0xD04;  // ICSR (PM0214, section 4.4.3)
    constexpr std::uint64_t kTickPending = 1u << 26;
    std::uint64_t state = 0;
    memory_region_dispatch_read(registers_, kControlAndState, &state, kMemOp32LittleEndian, 0);
    const auto lost = rule_.Tick({.at_ns = TimeOf(CLOCK_MONOTONIC),
                                  .run_ns = TimeOf(processor_clock_),
                                  .pending = (state & kTickPending) != 0});
    if (lost) notes_->LostTick(lost->begin_ns, lost->end_ns);
  }

  RealtimeNotes* notes_ = nullptr;
  clockid_t processor_clock_{};
  void *registers_ = nullptr, *input_ = nullptr;
  TickRule rule_;
};

}  // namespace tiltproof::qemu
