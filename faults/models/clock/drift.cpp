#include "faults/fault_type.h"

namespace tiltproof::faults {

FaultType ClockDrift() {
  return {.name = "clock.drift",
          .summary = "A node's clock runs at a wrong rate.",
          .semantics =
              "In the window the clock of the node, and all that the node counts by it, gains `ppm` "
              "microseconds a "
              "second on the world (loses them, when negative): a client that is fast by 100 ppm has a "
              "control period "
              "of 12 ms less 1.2 us. What the clock gained it keeps. Without `start_s` it begins at t = 0. "
              "Bytes keep "
              "the line's rate at the client: such drifts are far below what a UART tolerates. Several "
              "drifts of one "
              "clock do not overlap.",
          .parameters = {ClockNodeParameter(),
                         {.name = "ppm",
                          .unit = "ppm",
                          .min = -10'000.0,
                          .max = 10'000.0,
                          .doc = "how much too fast",
                          .example = 200.0,
                          .zero = 0.0,
                          .severity = Scale::kLinear}},
          .kind = ClockKind{.make = [](const Parameters& parameters) -> ClockAction {
            return DriftClock{.ppm = parameters.Number("ppm")};
          }},
          .needs = Needs::kClock};
}

}  // namespace tiltproof::faults
