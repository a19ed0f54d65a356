#include "faults/fault_type.h"

namespace tiltproof::faults {

FaultType ClockJump() {
  return {
      .name = "clock.jump",
      .summary = "A node's clock jumps.",
      .semantics =
          "Models a clock that is set while it is in use: by a time server, by an operator, at a leap "
          "second. At `start_s`, the clock of the node jumps forward by `jump_ms` (back when it is "
          "negative). After a jump forward, everything that was due in between is due at once. After a jump "
          "back, the node waits for that much longer. At `end_s`, when there is one, the clock jumps by the "
          "same amount in the other direction. A node never sees its time run backwards: its time stands "
          "still until the clock has caught up.",
      .source =
          "RFC 5905, Network Time Protocol Version 4, IETF, 2010 (a clock that is stepped, not slewed).",
      .parameters = {ClockNodeParameter(),
                     {.name = "jump_ms",
                      .unit = "ms",
                      .min = -10'000.0,
                      .max = 10'000.0,
                      .doc = "how far the clock jumps forward",
                      .example = 5.0,
                      .zero = 0.0,
                      .severity = Scale::kLinear}},
      .kind = ClockKind{.make = [](const Parameters& parameters) -> ClockAction {
        return JumpClock{.by_ns = FromSeconds(parameters.Number("jump_ms") * 1e-3)};
      }},
      .start = Bound::kRequired,
      .needs = Needs::kClockJump};
}

}  // namespace tiltproof::faults
