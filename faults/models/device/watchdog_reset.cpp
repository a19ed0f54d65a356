#include "faults/fault_type.h"

namespace tiltproof::faults {

FaultType DeviceWatchdogReset() {
  return {.name = "device.watchdog_reset",
          .summary = "Resets the firmware's processor, with the watchdog as the cause.",
          .semantics =
              "Like device.reset, but the firmware finds the independent watchdog as the cause of the reset "
              "(IWDGRSTF in RCC_CSR; RM0090, RCC). This tests what the firmware does on such a start, "
              "without a hang.",
          .parameters = {BootParameter()},
          .kind = DeviceKind{.make = [](const DeviceSetup&) -> DeviceAction { return ResetByWatchdog{}; },
                             .asks_restart = true},
          .start = Bound::kRequired,
          .end = Bound::kRefused,
          .duration_ms = "boot_ms",
          .needs = Needs::kEmulation};
}

}  // namespace tiltproof::faults
