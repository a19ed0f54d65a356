// The other end of harness/run/remote/remote_parts.h: runs one part of a lockstep flight in this process and
// answers the harness until it quits or is gone.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "harness/run/remote/channel.h"
#include "harness/scenario/scenario.h"
#include "plant/vehicle_model.h"

namespace tiltproof::harness {

// The scenario that a setup's text describes, and its model. Throws std::exception.
struct LoadedScenario {
  Scenario scenario;
  std::shared_ptr<const plant::VehicleModel> model;
};
using ScenarioLoader = std::function<LoadedScenario(const std::string& yaml)>;

// Each returns when the harness is done with it or gone.
void ServeLine(Channel& channel, const ScenarioLoader& load);
void ServePlant(Channel& channel, const ScenarioLoader& load);
// Installs a FirmwareGuard: call it once per process.
void ServeClient(Channel& channel, const ScenarioLoader& load);

}  // namespace tiltproof::harness
