#include "faults/fault_type.h"

namespace tiltproof::faults {

FaultType DeviceWatchdogReset() {
  return {.name = "device.watchdog_reset",
          .summary = "Resets the firmware's processor, with the watchdog as the cause.",
          .semantics =
              "Models the end of a hang, or of a program that was late once. Like device.reset, but the "
              "firmware finds the independent watchdog as the cause of the reset (IWDGRSTF in RCC_CSR; "
              "RM0090, RCC). This tests what the firmware does on such a start, without a hang.",
          .source = "STMicroelectronics, RM0090 Reference manual (STM32F4), IWDG and RCC (reset flags).",
          .parameters = {BootParameter()},
          .kind = DeviceKind{.make = [](const DeviceSetup&) -> DeviceAction { return ResetByWatchdog{}; },
                             .asks_restart = true},
          .start = Bound::kRequired,
          .end = Bound::kRefused,
          .duration_ms = "boot_ms",
          .needs = Needs::kEmulation};
}

}  // namespace tiltproof::faults
