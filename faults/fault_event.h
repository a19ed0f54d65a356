// Events that waiting faults must hear: a condition (`when`) that turned true or false, and the first
// activation of a fault that another one follows (`after`).
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
  enum class Kind : std::uint8_t { kConditionHolds, kConditionEnds, kFirstActivation };
  Kind kind{};
  std::size_t fault = 0;  // index in the scenario's list: of the fault with the condition, or that acted
  TimeNs time_ns = 0;     // simulation time from which it is so
  friend bool operator==(const FaultEvent&, const FaultEvent&) = default;
  TILTPROOF_FIELDS(kind, fault, time_ns)
};

}  // namespace tiltproof::faults
