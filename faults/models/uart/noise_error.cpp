#include "faults/fault_type.h"

namespace tiltproof::faults {

FaultType UartNoiseError() {
  return {
      .name = "uart.noise_error",
      .summary = "The firmware's receiver detects noise.",
      .semantics =
          "Models spikes that are shorter than a bit: the three samples of a bit differ, and two of them "
          "decide. A byte that this fault hits is delivered unchanged, with the noise flag (NF) set in the "
          "status register. The flag stays until the firmware reads the status register and then the data "
          "register (RM0090, section 30.3.3).",
      .source = "STMicroelectronics, RM0090 Reference manual (STM32F4), section 30.3.3 (noise error).",
      .parameters = {ProbabilityParameter("probability, per byte, that it has the flag", 0.01)},
      .kind = ReceiverKind{.mark = ReceiveMark::kNoise},
      .needs = Needs::kEmulation};
}

}  // namespace tiltproof::faults
