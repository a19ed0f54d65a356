#include "faults/fault_type.h"

namespace tiltproof::faults {

FaultType UartOverrun() {
  return {.name = "uart.overrun",
          .summary = "The firmware's receiver loses bytes, as if it had been read too late.",
          .semantics =
              "Models interrupts that are masked for longer than a byte takes. A byte that this fault hits "
              "is lost in the shift register. The data register keeps what it holds, and the overrun flag "
              "(ORE) is set when the byte would have been complete. The flag stays until the firmware reads "
              "the status register and then the data register (RM0090, section 30.3.3). So the firmware "
              "sees it with the byte before, if that is still unread, and otherwise with the next one.",
          .source = "STMicroelectronics, RM0090 Reference manual (STM32F4), section 30.3.3 (overrun error).",
          .parameters = {ProbabilityParameter("probability, per byte, that it is lost", 0.01)},
          .kind = ReceiverKind{.mark = ReceiveMark::kOverrun},
          .needs = Needs::kEmulation};
}

}  // namespace tiltproof::faults
