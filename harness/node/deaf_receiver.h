// Counts the bytes that a receiver of an emulated board gets in real time while faults hold the processor. A
// stopped processor keeps the first byte that arrives and loses the others, as on the chip (an overrun). One
// held in reset loses all. QEMU by itself would deliver everything afterwards.
//
//   DeafReceiver receiver(scenario);                       // one per line
//   bytes = bytes.first(receiver.Keeps(now, bytes.size()));
#pragma once

#include <algorithm>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "faults/device_command.h"
#include "harness/run/client_channel.h"
#include "harness/scenario/scenario.h"
#include "link/overloaded.h"

namespace tiltproof::harness {

class DeafReceiver {
 public:
  // Hears everything.
  DeafReceiver() = default;
  // `client`: its place in the scenario.
  explicit DeafReceiver(const Scenario& scenario, std::size_t client = 0) {
    for (const faults::DeviceCommand& command : ClientCommands(scenario, client))
      if (const auto register_free = HearsNextByte(command.action))
        spans_.push_back({command.at_ns, command.until_ns, *register_free});
  }

  // Number of bytes, counted from the first, that the firmware gets of those that arrive at `time_ns`
  // (simulation time).
  std::size_t Keeps(TimeNs time_ns, std::size_t size) {
    std::size_t kept = size;
    for (Span& span : spans_) {
      if (time_ns < span.begin_ns || time_ns >= span.end_ns) continue;
      kept = std::min<std::size_t>(kept, std::exchange(span.register_free, false) ? 1 : 0);
    }
    return kept;
  }

 private:
  // True if a processor that the action holds still accepts one byte; none when the action does not hold it.
  static std::optional<bool> HearsNextByte(const faults::DeviceAction& action) {
    using Answer = std::optional<bool>;
    return std::visit(Overloaded{[](const faults::StallProcessor&) -> Answer { return true; },
                                 [](const faults::ResetProcessor&) -> Answer { return false; },
                                 [](const faults::ResetByWatchdog&) -> Answer { return false; },
                                 [](const faults::HangProcessor&) -> Answer { return true; },
                                 [](const faults::DelayTask&) -> Answer { return std::nullopt; },
                                 [](const faults::SlowProcessor&) -> Answer { return std::nullopt; },
                                 [](const faults::FlipBits&) -> Answer { return std::nullopt; },
                                 [](const faults::DriftClock&) -> Answer { return std::nullopt; },
                                 [](const faults::JumpClock&) -> Answer { return std::nullopt; }},
                      action);
  }

  struct Span {
    TimeNs begin_ns, end_ns;
    bool register_free;
  };
  std::vector<Span> spans_;
};

}  // namespace tiltproof::harness
