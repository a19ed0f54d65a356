#include "faults/model.h"

namespace tiltproof::faults {

FaultType UartParityError() {
  return {.name = "uart.parity_error",
          .stage = Stage::kReceiver,
          .summary = "The firmware's receiver finds wrong parity.",
          .semantics =
              "A byte that meets this fault is delivered as it is, with the parity error flag (PE) set "
              "(RM0090, section 30.3.7). All lines of the harness are 8N1: without a parity bit no receiver "
              "checks any, so every client refuses this fault.",
          .parameters = {ProbabilityParameter("that a byte is delivered with the flag", 0.01)},
          .mark = ReceiveMark::kParity,
          .needs = Needs::kParityLine,
          .default_target = Target::kToClient};
}

}  // namespace tiltproof::faults
