// A trunk: a flight that flies to just before one of its faults begins, and waits there in its worker. For each flight
// that departs from it, the worker forks a copy of itself, which gets that flight's fault and flies the rest. So a search
// over the severity of a fault flies its past once for each seed.
//
//   FlightJob job{.name = "mass 2, seed 7", .scenario = scenario, .model = model, .means = means, .replay = {}};
//   job.departure = Departure{.trunk = "mass, seed 7", .fault = 0};
//
// Until the fault is given, it is open (faults::FaultSchedule::Give), so the trunk does not depend on it. A departed
// flight is the flight from the beginning to the bit. A copy has only the thread that flies. A firmware with threads of
// its own is not forked: its worker flies on as the first of the flights.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "harness/engine/flight_job.h"
#include "harness/engine/worker.h"
#include "harness/run/flight.h"

namespace tiltproof::harness {

// True if its means and its fault allow that it departs, and this saves time.
bool CanDepart(const FlightJob& job);

// The message that gives a waiting trunk the next flight's fault.
std::vector<std::uint8_t> GivenFault(const FlightJob& job);

// In the worker process.
class Trunk {
 public:
  // `channel`: a socket from which messages are read.
  Trunk(const FlightJob& job, WorkerReport& report, int channel, const std::atomic<bool>* interrupted);

  // Flies the job by `fly`. Returns in the copies, and in the worker itself where it could not fork: as the flight of one
  // job, whose fault `flown` gets. `drawn_before`: is set to the count of drawn numbers before that flight.
  RunLog Fly(const FlightOptions& options, const std::function<RunLog(const FlightOptions&)>& fly,
             Scenario& flown, std::uint64_t& drawn_before);

 private:
  faults::FaultSpec Depart();
  bool IsCopy();
  void Await(int copy) const;
  faults::FaultSpec Next() const;

  const FlightJob& job_;
  WorkerReport& report_;
  int channel_;
  const std::atomic<bool>* interrupted_;
};

}  // namespace tiltproof::harness
