#include "faults/fault_type.h"

namespace tiltproof::faults {

FaultType DeviceBitFlip() {
  return {.name = "device.bit_flip",
          .summary = "Flips bits of the firmware's memory, as radiation does.",
          .semantics =
              "Models single and multiple upsets by neutrons and alpha particles. At one instant, "
              "`bit_count` different bits of the region are flipped. All choices of bits are equally "
              "likely. The bits stay flipped until the firmware writes there. Without `end_s`, the instant "
              "is `start_s`. With `end_s`, it is drawn from the window, where every nanosecond is equally "
              "likely: flights with many seeds (`--repeat`) then sample memory and time. A region is `ram` "
              "(all of it), `data`, `bss`, `stack`, or an object of the firmware by its name in the ELF "
              "file.",
          .source =
              "JEDEC JESD89A, Measurement and Reporting of Alpha Particle and Terrestrial Cosmic "
              "Ray-Induced Soft Errors in Semiconductor Devices, 2006.",
          .parameters = {{.name = "region",
                          .unit = "",
                          .kind = ParameterKind::kText,
                          .doc = "ram, data, bss, stack, or the name of an object in the ELF file",
                          .example = "ram"},
                         {.name = "bit_count",
                          .unit = "1",
                          .kind = ParameterKind::kInteger,
                          .min = 1.0,
                          .max = 64.0,
                          .doc = "number of bits that are flipped at once",
                          .example = 1.0,
                          .default_value = 1.0}},
          .kind = DeviceKind{.make = [](const DeviceSetup& setup) -> DeviceAction {
                               return FlipBits{.region = setup.parameters.Text("region"),
                                               .bit_count = setup.parameters.Integer("bit_count"),
                                               .stream = setup.stream};
                             },
                             .at_an_instant = true},
          .start = Bound::kRequired,
          .needs = Needs::kProcessor};
}

}  // namespace tiltproof::faults
