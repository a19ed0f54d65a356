#include "faults/fault_type.h"

namespace tiltproof::faults {

FaultType DeviceTaskDelay() {
  return {
      .name = "device.task_delay",
      .summary = "The firmware's task runs late, because other work has the processor.",
      .semantics =
          "Models an interrupt routine or a task of higher priority that takes longer than planned. In the "
          "window, every `every_ms`, first at `start_s`, other work of a higher priority takes the "
          "processor for `delay_ms`. Whatever the firmware's task is to do meanwhile, a request that is due "
          "or a reply that has come, it does at the end of that time. Interrupts go on: the receiver loses "
          "no byte. An `every_ms` that is a multiple of the control period hits the same part of each "
          "period; another one moves through it. With a `delay_ms` of `every_ms` or more, the task does not "
          "run before the window ends. The task of an image is all code outside of interrupt handlers, in "
          "each of its threads. If an interrupt comes while the task has switched interrupts off, the task "
          "goes on until it switches them on. An activation is, for a library, a time in which the task had "
          "something to do, and for an image each time of the other work.",
      .source =
          "Joseph and Pandya, Finding Response Times in a Real-Time System, The Computer Journal 29(5), "
          "1986.",
      .parameters = {{.name = "delay_ms",
                      .unit = "ms",
                      .min = 0.0,
                      .max = 10'000.0,
                      .doc = "how long the other work takes",
                      .example = 4.0,
                      .zero = 0.0,
                      .severity = Scale::kLinear},
                     {.name = "every_ms",
                      .unit = "ms",
                      .min = 0.1,
                      .max = 1e6,
                      .doc = "from one begin of the other work to the next",
                      .example = 50.0}},
      .kind = DeviceKind{.make = [](const DeviceSetup& setup) -> DeviceAction {
        return DelayTask{.delay_ns = FromSeconds(setup.parameters.Number("delay_ms") * 1e-3),
                         .every_ns = FromSeconds(setup.parameters.Number("every_ms") * 1e-3)};
      }},
      .start = Bound::kRequired,
      .needs = Needs::kTask};
}

}  // namespace tiltproof::faults
