#include "faults/fault_type.h"

namespace tiltproof::faults {

FaultType DeviceHang() {
  return {.name = "device.hang",
          .summary = "The firmware hangs: only its watchdog can help.",
          .semantics =
              "From `start_s` on the processor executes nothing, as in an endless loop with interrupts "
              "masked, while time and peripherals go on. The independent watchdog, if the firmware has "
              "started it, resets the processor when it runs out, and the firmware starts again; otherwise "
              "the processor stands still to the end of the flight.",
          .kind = DeviceKind{.make = [](const DeviceSetup&) -> DeviceAction { return HangProcessor{}; },
                             .asks_restart = true},
          .start = Bound::kRequired,
          .end = Bound::kRefused,
          .needs = Needs::kEmulation};
}

}  // namespace tiltproof::faults
