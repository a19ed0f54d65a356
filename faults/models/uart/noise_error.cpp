#include "faults/fault_type.h"

namespace tiltproof::faults {

FaultType UartNoiseError() {
  return {
      .name = "uart.noise_error",
      .summary = "The firmware's receiver detects noise.",
      .semantics =
          "A byte that meets this fault is delivered as it is, with the noise flag (NF) set in the status "
          "register until the firmware reads the status and then the data register (RM0090, section 30.3.3).",
      .parameters = {ProbabilityParameter("that a byte is delivered with the flag", 0.01)},
      .kind = ReceiverKind{.mark = ReceiveMark::kNoise},
      .needs = Needs::kEmulation};
}

}  // namespace tiltproof::faults
