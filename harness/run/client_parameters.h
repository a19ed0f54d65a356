// Facts on the vehicle for a firmware that flies any: the text TiltproofHost::parameters (firmware/tiltproof_client.h).
//
//   ClientParameters(scenario, model);   // {"vehicle": {"name": "quadrotor", ...
//   GainOf(scenario, model);             // inputs x (states and integrals)
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "harness/scenario/scenario.h"
#include "plant/lqr_design.h"
#include "plant/vehicle_model.h"

namespace tiltproof::harness {

// The gain of the scenario's `gain`: its file, or the default design for the protocol's control period. Throws
// plant::DesignError when there is none, with the file's place.
plant::GainMatrix GainOf(const Scenario& scenario, const plant::VehicleModel& model);

// The states of the vehicle that the build `lqr` finds in none of the server's messages. It computes roll, pitch and yaw
// from a quaternion, and the angular rates from a gyro.
std::vector<std::string> StatesNotCarried(const link::Protocol& protocol, const VehicleSignals& vehicle);

// A vehicle without a gain has the gain null, except for the build `lqr`: then throws plant::DesignError.
std::string ClientParameters(const Scenario& scenario, const plant::VehicleModel& model,
                             std::size_t client = 0);

}  // namespace tiltproof::harness
