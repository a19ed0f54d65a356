#include "faults/fault_type.h"

namespace tiltproof::faults {

FaultType UartOverrun() {
  return {.name = "uart.overrun",
          .summary = "The firmware's receiver loses bytes, as if it had been read too late.",
          .semantics =
              "A byte that meets this fault is lost in the shift register: the data register keeps what it "
              "holds, and the overrun flag (ORE) is set when the byte would have been complete. The flag "
              "stays until the firmware reads the status and then the data register (RM0090, section "
              "30.3.3), so it comes with the byte before, if that is still unread, else with the next one.",
          .parameters = {ProbabilityParameter("that a byte is lost", 0.01)},
          .kind = ReceiverKind{.mark = ReceiveMark::kOverrun},
          .needs = Needs::kEmulation};
}

}  // namespace tiltproof::faults
