// The lockstep conductor: flies one scenario in virtual time, deterministic to the bit.
//
// The client leads: it says out of band until when it waits, and the conductor advances to the earlier of
// that time and the next byte worth waking somebody for. One control period, in the order of the code:
//
//   request arrives -> plant state -> sensor faults -> message -> frame -> wire (faults) -> firmware ->
//   message -> frame -> wire (faults) -> decode -> actuator faults -> input in force from the next step
//   boundary -> log
//
// Sensors are the state at the last step boundary at or before the arrival of the request's last byte. An
// accepted actuator message takes effect at the first step boundary at or after its last byte's arrival and
// holds; before the first one the model's hover input holds. The plant stands still until the server accepts
// `start` (provant: the first id 3): that is t = 0.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>

#include "harness/client/client.h"
#include "harness/run/run_log.h"
#include "harness/scenario/scenario.h"
#include "plant/vehicle_model.h"

namespace tiltproof::harness {

struct FlightOptions {
  // Makes the client once its host functions exist.
  std::function<std::unique_ptr<Client>(ClientHost)> make_client;
  // Simulation time reached, for a progress display; may be null. Written once a period.
  std::atomic<std::int64_t>* progress_ns = nullptr;
  // Set by somebody else to end the flight early (Ctrl-C); may be null.
  const std::atomic<bool>* interrupted = nullptr;
};

// Flies to the end, or to what ends it early (RunLog::end_reason): divergence, ground strike, a hung or
// crashed firmware, an interrupt. Throws std::runtime_error when the client cannot be made.
RunLog Fly(const Scenario& scenario, const plant::VehicleModel& model, const FlightOptions& options);

}  // namespace tiltproof::harness
