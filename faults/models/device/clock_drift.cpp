#include "faults/model.h"

namespace tiltproof::faults {

FaultType DeviceClockDrift() {
  return {.name = "device.clock_drift",
          .stage = Stage::kDevice,
          .summary = "The device's clock runs at a wrong rate.",
          .semantics =
              "In the window the processor's clock, and all that its timers and the firmware count by it, "
              "gains `ppm` microseconds a second on the world (loses them, when negative). What it gained it "
              "keeps. Without `start_s` it begins at t = 0. Bytes keep the line's rate: such drifts are far "
              "below what a UART tolerates.",
          .parameters = {{.name = "ppm",
                          .unit = "ppm",
                          .min = -10'000.0,
                          .max = 10'000.0,
                          .doc = "how much too fast",
                          .example = 200.0,
                          .zero = 0.0}},
          .on_device = true,
          .needs = Needs::kEmulation};
}

}  // namespace tiltproof::faults
