#include "faults/fault_type.h"

namespace tiltproof::faults {

FaultType DeviceHang() {
  return {.name = "device.hang",
          .summary = "The firmware hangs: only its watchdog can help.",
          .semantics =
              "From `start_s` on, the processor executes nothing, as in an endless loop with interrupts "
              "masked, while time and peripherals continue. If the firmware has started the independent "
              "watchdog, the watchdog resets the processor when it expires, and the firmware starts again. "
              "Otherwise the processor stands still until the end of the flight.",
          .kind = DeviceKind{.make = [](const DeviceSetup&) -> DeviceAction { return HangProcessor{}; },
                             .asks_restart = true},
          .start = Bound::kRequired,
          .end = Bound::kRefused,
          .needs = Needs::kEmulation};
}

}  // namespace tiltproof::faults
