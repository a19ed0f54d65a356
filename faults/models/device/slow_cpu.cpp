#include "faults/fault_type.h"

namespace tiltproof::faults {

FaultType DeviceSlowCpu() {
  return {
      .name = "device.slow_cpu",
      .summary = "The processor computes more slowly.",
      .semantics =
          "Models a processor that has lowered its clock because of heat or voltage, or that shares caches "
          "and memory with other work. In the window, the computing that the firmware states takes `factor` "
          "times as long (`docs/nmpc.md`). Of a computation that is only partly in the window, that part is "
          "stretched. All else of the firmware takes no time, as before. Several of these faults multiply. "
          "An activation is a computation that is stretched.",
      .source =
          "Brooks and Martonosi, Dynamic Thermal Management for High-Performance Microprocessors, HPCA 2001.",
      .parameters = {{.name = "factor",
                      .unit = "1",
                      .min = 1.0,
                      .max = 1000.0,
                      .doc = "how many times longer computing takes",
                      .example = 2.0,
                      .zero = 1.0,
                      .severity = Scale::kLinear}},
      .kind = DeviceKind{.make = [](const DeviceSetup& setup) -> DeviceAction {
        return SlowProcessor{.factor = setup.parameters.Number("factor")};
      }},
      .start = Bound::kRequired,
      .needs = Needs::kComputing};
}

}  // namespace tiltproof::faults
