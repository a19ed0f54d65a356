#include "faults/fault_type.h"

namespace tiltproof::faults {

FaultType UartFramingError() {
  return {.name = "uart.framing_error",
          .summary = "The firmware's receiver misses stop bits.",
          .semantics =
              "Models noise on the stop bit, or a sender whose baud rate is off a little. A byte that this "
              "fault hits is delivered unchanged, with the framing error flag (FE) set in the status "
              "register. The flag stays until the firmware reads the status register and then the data "
              "register (RM0090, section 30.3.3).",
          .source = "STMicroelectronics, RM0090 Reference manual (STM32F4), section 30.3.3 (framing error).",
          .parameters = {ProbabilityParameter("probability, per byte, that it has the flag", 0.01)},
          .kind = ReceiverKind{.mark = ReceiveMark::kFraming},
          .needs = Needs::kEmulation};
}

}  // namespace tiltproof::faults
