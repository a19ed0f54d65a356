// Redundancy of several clients in a flight, in numbers: totals of the arbiter's decisions (docs/redundancy.md).
#pragma once

#include <cstdint>
#include <optional>

#include "link/fields.h"
#include "link/time.h"

namespace tiltproof::harness {

// Totals of an arbiter that chooses in flight. Times are whole steps of the plant.
struct RedundancyTotals {
  std::int64_t switches_count = 0;
  TimeNs without_control_ns = 0;  // no client's command was in force, although one had been accepted before
  double largest_bump = 0;        // the largest step of an input at a switch, as a share of the input's range
  std::optional<TimeNs> split_brain_ns = {};   // two or more clients claimed; none: no client tells a role
  std::optional<TimeNs> disagreement_ns = {};  // duplex_compare only
  friend bool operator==(const RedundancyTotals&, const RedundancyTotals&) = default;
  static constexpr bool kLeavesOutNull = true;
  TILTPROOF_FIELDS(switches_count, without_control_ns, largest_bump, split_brain_ns, disagreement_ns)
};

}  // namespace tiltproof::harness
