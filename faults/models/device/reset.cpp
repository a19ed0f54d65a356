#include "faults/fault_type.h"

namespace tiltproof::faults {

FaultType DeviceReset() {
  return {.name = "device.reset",
          .summary = "Resets the firmware's processor, as its reset pin does.",
          .semantics =
              "Models a dip of the supply, a pulse on the reset pin, or a reset that the software asks for. "
              "At `start_s`, the processor and its peripherals are reset, and held in reset for `boot_ms`. "
              "Then the firmware starts from its reset vector. Meanwhile it receives nothing, and a byte "
              "that it was sending is cut off. The fault is active while the processor is held.",
          .source =
              "STMicroelectronics, RM0090 Reference manual (STM32F4), RCC (system reset); Cristian, "
              "Understanding Fault-tolerant Distributed Systems, Communications of the ACM 34(2), 1991 "
              "(amnesia crashes).",
          .parameters = {BootParameter()},
          .kind = DeviceKind{.make = [](const DeviceSetup&) -> DeviceAction { return ResetProcessor{}; },
                             .asks_restart = true},
          .start = Bound::kRequired,
          .end = Bound::kRefused,
          .duration_ms = "boot_ms",
          .needs = Needs::kReset};
}

}  // namespace tiltproof::faults
