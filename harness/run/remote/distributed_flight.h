// A lockstep flight with each line, the plant and each firmware in its own process: the same conductor, the
// same trace hash, and proof that nothing hides in shared memory.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>
#include <vector>

#include "harness/run/bus_place.h"
#include "harness/run/flight.h"
#include "harness/run/run_log.h"
#include "harness/scenario/client_spec.h"
#include "harness/scenario/scenario.h"
#include "plant/vehicle_model.h"

namespace tiltproof::harness {

enum class Transport : std::uint8_t { kDds, kSocket };

struct DistributedOptions {
  Transport transport = Transport::kDds;
  std::string program;              // this program, to start the processes with
  std::string scenario_yaml;        // the resolved scenario
  std::vector<ClientSpec> clients;  // in the scenario's order
  BusPlace place;                   // over DDS
  std::atomic<std::int64_t>* progress_ns = nullptr;
  const std::atomic<bool>* interrupted = nullptr;
};

// Throws std::runtime_error when the processes cannot be started.
RunLog FlyDistributed(const Scenario& scenario, const VehicleSignals& vehicle,
                      const DistributedOptions& options);

// With only the firmware in other processes, connected by sockets. Each of several clients must have its own
// process, because a firmware may keep its state in static variables.
// `flight`: without make_client.
RunLog FlyClientsApart(const Scenario& scenario, const plant::VehicleModel& model,
                       const DistributedOptions& options, FlightOptions flight);

}  // namespace tiltproof::harness
