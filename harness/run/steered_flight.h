// A flight in lockstep that is steered from outside: it stands still at power-on and at each row of its trace, and its
// steersman reads signals, adds and ends faults, or stops it. tiltproof session does so for scripts.
//
//   FlightOptions options;
//   Scenario flown = scenario;
//   options.flown = &flown;                       // becomes the scenario that was flown
//   options.steer = [](SteeredFlight& flight) {   // called at each row
//     if (flight.time_ns() >= 10 * kNsPerS) flight.Stop();
//   };
//
// The scenario that was flown, from a file, flies the same to the bit. So a fault begins at the row, or, on a line that is
// busy then, when that is free.
#pragma once

#include <cstddef>
#include <vector>

#include "faults/fault.h"
#include "link/time.h"

namespace tiltproof::harness {

class SteeredFlight {
 public:
  virtual ~SteeredFlight() = default;
  // Simulation time; 0 at power-on, too, where nothing has been sent yet.
  virtual TimeNs time_ns() const = 0;
  // The values of the trace's columns, in its order. State and reference are those of the present time, all else is the
  // last before it: conditions of faults see the same. Columns of added faults are missing. Valid until the next call.
  virtual const std::vector<double>& Row() = 0;
  // The first time at which a fault of this type can begin or end: now, or soon.
  virtual TimeNs FaultTime(const faults::FaultSpec& fault) const = 0;
  // Adds a fault, which begins at FaultTime() or later, depends on the clock alone, and does not act on a node. Its place is
  // the next one in the scenario. A client that runs on (Client::RunsOn) takes none on its clock.
  virtual void Add(const faults::FaultSpec& fault) = 0;
  // Ends a fault of the scenario, by its place, at FaultTime(). It is not on the device, which has its commands already.
  virtual void Remove(std::size_t fault) = 0;
  // The flight ends here, at power-on after one control period, as if that were its duration.
  virtual void Stop() = 0;
};

}  // namespace tiltproof::harness
