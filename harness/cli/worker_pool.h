// Flies scenarios in worker processes, one process a flight: a firmware library always gets a fresh one, a
// crash of the firmware or of ours costs one scenario, and -j changes nothing but the wall-clock time.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "harness/report/results.h"
#include "harness/run/bus_place.h"
#include "harness/run/remote/distributed_flight.h"
#include "harness/scenario/client_spec.h"
#include "harness/scenario/scenario.h"
#include "plant/vehicle_model.h"

namespace tiltproof::harness {

// How flights of a run are flown.
struct FlightMeans {
  RunClients clients;
  bool realtime = false;
  std::optional<Transport> distributed;  // lockstep with every part in a process of its own
  bool attach = false;                   // realtime: with nodes that run already
  int domain = 0;                        // 0: the first free one
  std::string interface;
  std::vector<std::string> peers;

  // Of a scenario's clients, in its order.
  std::vector<ClientSpec> ClientsOf(const Scenario& scenario) const;
  // Whether a worker process has the firmware in it.
  bool FirmwareInWorker(const Scenario& scenario) const;
  // As run.json keeps it.
  std::string client_text() const { return attach ? "attached" : ToText(clients.all); }
};

struct FlightJob {
  Scenario scenario;
  std::shared_ptr<const plant::VehicleModel> model;
  FlightMeans means;
  std::filesystem::path folder;  // created by the worker; the scenario's own
  std::string replay;            // the exact command that flies it again
};

struct PoolOptions {
  int jobs_count = 1;
  bool fail_fast = false;
  bool progress = false;  // one updating line on standard error
};

struct PoolOutcome {
  std::vector<ScenarioResult> results;  // in the order of the jobs; those not flown are missing
  std::vector<std::string> not_flown;   // after an interrupt or --fail-fast
  bool interrupted = false;
};

// `on_finished` is called for each result as it comes, `on_turn` some ten times a second, `on_place` when a flight
// of this name goes on the bus. SIGINT and SIGTERM end
// the flights under way, whose partial results are kept.
PoolOutcome FlyAll(
    const std::vector<FlightJob>& jobs, const PoolOptions& options,
    const std::function<void(const ScenarioResult&)>& on_finished,
    const std::function<void()>& on_turn = [] {},
    const std::function<void(const std::string&, const BusPlace&)>& on_place = [](const auto&,
                                                                                  const auto&) {});

}  // namespace tiltproof::harness
