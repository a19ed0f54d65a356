#include "faults/fault_type.h"

namespace tiltproof::faults {

FaultType DeviceStall() {
  return {
      .name = "device.stall",
      .summary = "The processor stands still for a while.",
      .semantics =
          "From `start_s` to `end_s` the processor executes nothing, interrupts included, while time and "
          "peripherals go on: its timers count, its receiver overruns. Then it goes on where it was; or, if "
          "an independent watchdog ran out meanwhile, from its reset vector.",
      .kind = DeviceKind{.make = [](const DeviceSetup&) -> DeviceAction { return StallProcessor{}; }},
      .start = Bound::kRequired,
      .end = Bound::kRequired,
      .needs = Needs::kProcessor};
}

}  // namespace tiltproof::faults
