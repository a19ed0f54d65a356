#include "faults/fault_type.h"

namespace tiltproof::faults {

FaultType DeviceWatchdogReset() {
  return {.name = "device.watchdog_reset",
          .summary = "Resets the firmware's processor, and says that it was the watchdog.",
          .semantics =
              "As device.reset, but the firmware finds the independent watchdog as the reset's cause "
              "(IWDGRSTF in RCC_CSR; RM0090, RCC). What it does on such a start is tested without a hang.",
          .parameters = {BootParameter()},
          .kind = DeviceKind{.make = [](const DeviceSetup&) -> DeviceAction { return ResetByWatchdog{}; },
                             .asks_restart = true},
          .start = Bound::kRequired,
          .end = Bound::kRefused,
          .duration_ms = "boot_ms",
          .needs = Needs::kEmulation};
}

}  // namespace tiltproof::faults
