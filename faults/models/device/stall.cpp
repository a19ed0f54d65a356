#include "faults/fault_type.h"

namespace tiltproof::faults {

FaultType DeviceStall() {
  return {
      .name = "device.stall",
      .summary = "The processor stands still for a while.",
      .semantics =
          "Models code in a flash memory that is being erased, which cannot be read meanwhile. From "
          "`start_s` to `end_s`, the processor executes nothing, interrupts included, while time and "
          "peripherals continue: its timers count, and its receiver overruns. Then it continues where it "
          "was. If an independent watchdog has expired meanwhile, it starts from its reset vector instead. "
          "`period_s` and `duty` repeat it: with `period_s: 0.02` and `duty: 0.15`, for 3 ms out of every "
          "20.",
      .source =
          "STMicroelectronics, RM0090 Reference manual (STM32F4), embedded Flash memory interface (a read "
          "during an erase stalls the bus).",
      .kind = DeviceKind{.make = [](const DeviceSetup&) -> DeviceAction { return StallProcessor{}; }},
      .start = Bound::kRequired,
      .end = Bound::kRequired,
      .needs = Needs::kProcessor};
}

}  // namespace tiltproof::faults
