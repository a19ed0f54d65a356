#include "faults/fault_type.h"

namespace tiltproof::faults {

FaultType DeviceStall() {
  return {
      .name = "device.stall",
      .summary = "The processor stands still for a while.",
      .semantics =
          "From `start_s` to `end_s`, the processor executes nothing, interrupts included, while time and "
          "peripherals continue: its timers count, and its receiver overruns. Then it continues where it "
          "was. If an independent watchdog has expired meanwhile, it starts from its reset vector instead.",
      .kind = DeviceKind{.make = [](const DeviceSetup&) -> DeviceAction { return StallProcessor{}; }},
      .start = Bound::kRequired,
      .end = Bound::kRequired,
      .needs = Needs::kProcessor};
}

}  // namespace tiltproof::faults
