#include "faults/fault_type.h"

namespace tiltproof::faults {

FaultType DeviceHang() {
  return {.name = "device.hang",
          .summary = "The firmware hangs: only its watchdog can help.",
          .semantics =
              "Models an endless loop or a deadlock with interrupts masked. From `start_s` on, the processor "
              "executes nothing, while time and peripherals continue. If the firmware has started the "
              "independent watchdog, the watchdog resets the processor when it expires, and the firmware "
              "starts again. Otherwise the processor stands still until the end of the flight.",
          .source =
              "Avizienis et al., Basic Concepts and Taxonomy of Dependable and Secure Computing, IEEE "
              "Transactions on Dependable and Secure Computing 1(1), 2004 (halt failures); "
              "STMicroelectronics, RM0090 Reference manual (STM32F4), IWDG.",
          .kind = DeviceKind{.make = [](const DeviceSetup&) -> DeviceAction { return HangProcessor{}; },
                             .asks_restart = true},
          .start = Bound::kRequired,
          .end = Bound::kRefused,
          .needs = Needs::kEmulation};
}

}  // namespace tiltproof::faults
