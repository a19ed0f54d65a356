// From paths on the command line to scenarios that are ready to fly: found, read, selected, their models loaded.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "harness/scenario/reader.h"
#include "harness/scenario/scenario.h"
#include "plant/vehicle_model.h"

namespace tiltproof::harness {

struct SuiteScenario {
  Scenario scenario;
  std::shared_ptr<const plant::VehicleModel> model;
};

struct Suite {
  std::string name;  // of the folder, or of the file without its ending
  std::vector<SuiteScenario> scenarios;
  std::vector<std::string> warnings;  // about models, each once
};

// Throws UsageError with every problem of every file, one a line.
Suite LoadSuite(const std::vector<std::filesystem::path>& paths);

// How scenario files are read here: models folder, formula and metric checks.
ReadOptions MakeReadOptions();

// MODEL of design-lqr and `model:` alike: a name in the models folder, or a path ending in .sdf. Throws UsageError.
std::filesystem::path ResolveModel(const std::string& model);

}  // namespace tiltproof::harness
