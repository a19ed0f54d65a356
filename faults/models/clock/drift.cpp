#include "faults/fault_type.h"

namespace tiltproof::faults {

FaultType ClockDrift() {
  return {.name = "clock.drift",
          .summary = "A node's clock runs at a wrong rate.",
          .semantics =
              "Models a crystal that is off by its tolerance, its temperature or its age, or an oscillator "
              "without a crystal. In the window, the clock of the node gains `ppm` microseconds per second "
              "on the true time (it loses them when `ppm` is negative). Everything that the node times by "
              "this clock follows: a client that is fast by 100 ppm has a control period of 12 ms less 1.2 "
              "us. The clock keeps the time that it has gained. Without `start_s`, the drift begins at t = "
              "0. At the client, bytes keep the rate of the line: such drifts are far below what a UART "
              "tolerates. Drifts of the same clock do not overlap.",
          .source =
              "RFC 5905, Network Time Protocol Version 4, IETF, 2010 (frequency error, and which of it is "
              "tolerated).",
          .parameters = {ClockNodeParameter(),
                         {.name = "ppm",
                          .unit = "ppm",
                          .min = -10'000.0,
                          .max = 10'000.0,
                          .doc = "how much too fast the clock runs",
                          .example = 200.0,
                          .zero = 0.0,
                          .severity = Scale::kLinear}},
          .kind = ClockKind{.make = [](const Parameters& parameters) -> ClockAction {
            return DriftClock{.ppm = parameters.Number("ppm")};
          }},
          .needs = Needs::kClock};
}

}  // namespace tiltproof::faults
