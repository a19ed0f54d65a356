// A future of a flight: a flight that is the same up to a time, and departs there. Faults end, and what is random is drawn
// again. tiltproof why flies many futures of one flight.
//
//   const Future future{.from_ns = 12 * kNsPerS, .cut = {0, 1}, .draw = 7};
//   FlightOptions options;
//   options.future = future;
//
// The departure is at the first turn of the conductor at or after `from_ns`. Until then the flight is the same to the
// bit.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "harness/scenario/scenario.h"
#include "link/time.h"

namespace tiltproof::harness {

struct Future {
  TimeNs from_ns = kPowerOn;     // simulation time; kPowerOn: from the beginning
  std::vector<std::size_t> cut;  // faults that end there, by their places in the scenario
  std::uint64_t draw = 0;        // names other random numbers, from there on; 0: those of the flight
  std::optional<faults::FaultSpec> given = {};  // the open fault of the flight (FlightOptions::open)
};

// The scenario with the windows that the faults have in this future, for the scorer.
Scenario WithFuture(Scenario scenario, const Future& future);

}  // namespace tiltproof::harness
