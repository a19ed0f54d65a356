#include "faults/model.h"

namespace tiltproof::faults {

FaultType ClockSkew() {
  return {.name = "clock.skew",
          .stage = Stage::kNode,
          .summary = "Lets a node's clock run wrong.",
          .semantics =
              "In the window the node's clock is ahead by `offset_ms`, and gains `ppm` microseconds a second "
              "from the "
              "window's begin on (loses them, when negative); after the window it is right again. Without "
              "`start_s` it "
              "is wrong from the node's start. The client's period of 12 ms is by its own clock.",
          .parameters = {NodeParameter({"client", "plant", "base_station"}),
                         {.name = "ppm",
                          .unit = "ppm",
                          .min = -100'000.0,
                          .max = 100'000.0,
                          .doc = "how much too fast",
                          .example = 200.0,
                          .zero = 0.0},
                         {.name = "offset_ms",
                          .unit = "ms",
                          .min = -10'000.0,
                          .max = 10'000.0,
                          .doc = "ahead from the begin on",
                          .example = 5.0,
                          .default_value = 0.0,
                          .zero = 0.0}},
          .on_node = true,
          .needs = Needs::kNodes};
}

}  // namespace tiltproof::faults
