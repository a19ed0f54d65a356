// Events that faults must hear: a condition (`when`) that turned true or false, the first activation of a fault that
// another one follows (`after`), and the early end of a fault (harness/run/future.h).
//
// Each part of a flight has its own FaultSchedule. Conditions are known where the plant is, activations where
// the fault acts. The conductor of the flight passes on the events of each part before anything else passes:
//
//   const std::vector<FaultEvent> events = line_faults.PollEvents();
//   plant_faults.Hear(events);
#pragma once

#include <cstddef>
#include <cstdint>

#include "link/fields.h"
#include "link/time.h"

namespace tiltproof::faults {

struct FaultEvent {
  enum class Kind : std::uint8_t { kConditionHolds, kConditionEnds, kFirstActivation, kCut };
  Kind kind{};
  std::size_t fault = 0;  // index in the scenario's list: of the fault with the condition, that acted, or that ends
  TimeNs time_ns = 0;     // simulation time from which it is so
  friend bool operator==(const FaultEvent&, const FaultEvent&) = default;
  TILTPROOF_FIELDS(kind, fault, time_ns)
};

}  // namespace tiltproof::faults
