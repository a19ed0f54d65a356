// The lockstep conductor: flies one scenario in virtual time, deterministic to the bit.
//
// The client leads: it says out of band until when it waits. The conductor advances to that time, or to the
// next byte that a part must see, whichever is earlier. One control period, in the order of the code:
//
//   request arrives -> PlantServer -> Line (faults) -> firmware -> Line (faults) -> PlantServer
//
// The conductor knows three parts, Line, PlantServer and Client, and each may be in its own process. A line
// and its client form a channel (harness/run/client_channel.h). A flight has one plant, and one channel per
// client.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "harness/client/make_client.h"
#include "harness/run/future.h"
#include "harness/run/line.h"
#include "harness/run/log_builder.h"
#include "harness/run/plant_server.h"
#include "harness/run/run_log.h"
#include "harness/run/steered_flight.h"
#include "harness/scenario/scenario.h"
#include "plant/vehicle_model.h"

namespace tiltproof::harness {

struct FlightOptions {
  // Makes a client, by its place in the scenario, once its host functions exist.
  std::function<std::unique_ptr<Client>(std::size_t client, ClientHost)> make_client;
  // Simulation time reached, for a progress display; may be null. Written once a period.
  std::atomic<std::int64_t>* progress_ns = nullptr;
  // Takes each client when the flight is over. Without it the client ends at that time.
  std::function<void(std::unique_ptr<Client>)> retire = {};
  // Set from outside to end the flight early (Ctrl-C); may be null.
  const std::atomic<bool>* interrupted = nullptr;
  // Gets the flight's records as they are made, and must not make it wait; may be null.
  RecordSink* observer = nullptr;
  // The flight that is flown is this future of the scenario's.
  std::optional<Future> future = {};
  // Simulation times, ascending. `at_moment` is called with the index of each, before anything happens at or after it. The
  // flight goes on as the future that it returns; none: as before. Such a future does not take back commands to a
  // client's board. An end of the flight comes first.
  std::vector<TimeNs> moments = {};
  std::function<std::optional<Future>(std::size_t moment)> at_moment = {};
  // The place of a fault of the scenario that is open until a future gives it (FaultSchedule::Give).
  std::optional<std::size_t> open = {};
  // False: the log has only the counts of activations.
  bool keeps_activations = true;
  // The log has only these parts.
  LogParts parts = {};
  // Called at power-on and at each row; none: the flight is not steered. Then `flown` is a copy of the scenario, which gets
  // what is changed.
  std::function<void(SteeredFlight& flight)> steer = {};
  Scenario* flown = nullptr;
};

// Flies to the end, or to what ends it early (RunLog::end_reason): divergence, ground strike, a hung or
// crashed firmware, an interrupt. Throws std::runtime_error when the client cannot be made.
RunLog Fly(const Scenario& scenario, const plant::VehicleModel& model, const FlightOptions& options);

// The same with lines, one per client, and a plant that the caller provides, in this process or in others. They write
// to `log`.
RunLog Conduct(const Scenario& scenario, std::span<Line* const> lines, PlantServer& server, LogBuilder& log,
               const FlightOptions& options);

// The scenario's requirements for a client.
ClientSettings SettingsOf(const Scenario& scenario, std::size_t client = 0);

// The message to the user when the flight never began.
std::string NeverStartedText(const Scenario& scenario);

}  // namespace tiltproof::harness
