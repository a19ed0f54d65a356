#include "faults/fault_type.h"

namespace tiltproof::faults {

FaultType ClockJump() {
  return {
      .name = "clock.jump",
      .summary = "A node's clock jumps.",
      .semantics =
          "At `start_s` the clock of the node jumps forward by `jump_ms` (back, when negative): what was due "
          "meanwhile is due at once, and after a jump back the node waits for as long. At `end_s`, when "
          "there is "
          "one, it jumps back by as much. No node sees its time run backwards: it stands until the clock has "
          "caught "
          "up.",
      .parameters = {ClockNodeParameter(),
                     {.name = "jump_ms",
                      .unit = "ms",
                      .min = -10'000.0,
                      .max = 10'000.0,
                      .doc = "how far forward",
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
