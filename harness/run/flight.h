// The lockstep conductor: flies one scenario in virtual time, deterministic to the bit.
//
// The client leads: it says out of band until when it waits, and the conductor advances to the earlier of
// that time and the next byte worth waking somebody for. One control period, in the order of the code:
//
//   request arrives -> PlantServer -> Line (faults) -> firmware -> Line (faults) -> PlantServer
//
// It knows three parts, Line, PlantServer and Client, and each may be in a process of its own.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "harness/client/make_client.h"
#include "harness/run/line.h"
#include "harness/run/plant_server.h"
#include "harness/run/run_log.h"
#include "harness/scenario/scenario.h"
#include "plant/vehicle_model.h"

namespace tiltproof::harness {

struct FlightOptions {
  // Makes the client once its host functions exist.
  std::function<std::unique_ptr<Client>(ClientHost)> make_client;
  // Simulation time reached, for a progress display; may be null. Written once a period.
  std::atomic<std::int64_t>* progress_ns = nullptr;
  // Takes the client when the flight is over; without it the client ends then.
  std::function<void(std::unique_ptr<Client>)> retire = {};
  // Set by somebody else to end the flight early (Ctrl-C); may be null.
  const std::atomic<bool>* interrupted = nullptr;
};

// Flies to the end, or to what ends it early (RunLog::end_reason): divergence, ground strike, a hung or
// crashed firmware, an interrupt. Throws std::runtime_error when the client cannot be made.
RunLog Fly(const Scenario& scenario, const plant::VehicleModel& model, const FlightOptions& options);

// The same with the line and the plant where the caller has them, in this process or in others.
RunLog Conduct(const Scenario& scenario, Line& line, PlantServer& server, const FlightOptions& options);

// What the scenario asks of its client.
ClientSettings SettingsOf(const Scenario& scenario);

// What a person reads when the flight never began.
std::string NeverStartedText(const Scenario& scenario);

}  // namespace tiltproof::harness
