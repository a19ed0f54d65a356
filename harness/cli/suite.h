// Turns paths on the command line into scenarios that are ready to fly: found, read, their models loaded.
#pragma once

#include <array>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "harness/cli/sweep.h"
#include "harness/run/remote/serve.h"
#include "harness/scenario/client_spec.h"
#include "harness/scenario/reader.h"
#include "harness/scenario/scenario.h"
#include "plant/vehicle_model.h"

namespace tiltproof::harness {

// The builds of the shipped firmware.
inline constexpr std::array<std::string_view, 6> kShippedBuilds = {"paper",    "paper_published", "tolerant",
                                                                   "failover", "triplex",         "lqr"};

// Those that the clients fly; empty when one of them is no shipped firmware, and any build may be named.
std::span<const std::string_view> BuildsOfClients(const RunClients& clients);

// Throws UsageError, with the nearest name, for a build (of the flag --firmware) that is not among them.
void CheckBuild(const std::string& build);

// Loads each vehicle file once, even if several scenarios fly it.
class ModelCache {
 public:
  // Throws what plant::LoadVehicle throws.
  std::shared_ptr<const plant::VehicleModel> Load(const std::filesystem::path& file,
                                                  bool allow_invalid_inertia);
  // Keeps the vehicle of a scenario, which is loaded already.
  void Add(const Scenario& scenario, std::shared_ptr<const plant::VehicleModel> model);
  // The warnings of loading, each once.
  const std::vector<std::string>& warnings() const { return warnings_; }

 private:
  struct Entry {
    std::filesystem::path file;
    bool allow_invalid_inertia;
    std::shared_ptr<const plant::VehicleModel> model;
  };
  std::vector<Entry> entries_;
  std::vector<std::string> warnings_;
};

struct SuiteScenario {
  Scenario scenario;
  std::shared_ptr<const plant::VehicleModel> model;
  bool named = false;                // its file is on the command line; otherwise it was found in a folder
  std::vector<KeySetting> settings;  // of --set: they differ from the file
};

struct Suite {
  std::string name;  // of the folder, or of the file without its ending
  std::vector<SuiteScenario> scenarios;
  std::vector<std::string> warnings;
};

// Throws UsageError with every problem of every file, one per line. The shipped firmware restricts `firmware`
// to its builds; with another client it may be any word. `build`: of --firmware, flown by every client instead of
// what the files say; empty: not given.
Suite LoadSuite(const std::vector<std::filesystem::path>& paths, const RunClients& clients,
                const std::string& build = "");

// Puts a scenario for each cell of the grid in place of each scenario. `clients` and `build`: as it was loaded. Throws
// UsageError, with the flag, for a setting that the scenario cannot have.
void Sweep(const std::vector<SweepAxis>& sweep, const RunClients& clients, const std::string& build,
           Suite& suite);

// The scenario with another value for one key. Throws std::runtime_error with the reason that it cannot have it.
Scenario WithKey(const Scenario& scenario, const KeySetting& setting, ModelCache& models);

// A scenario that was flown before, from its folder. Throws UsageError.
LoadedScenario LoadFlown(const std::filesystem::path& scenario_folder);
// The same for many folders, with the vehicles that are loaded already.
LoadedScenario LoadFlown(const std::filesystem::path& scenario_folder, ModelCache& models);

// The scenario that a harness announces to its nodes, from a resolved scenario's text. Throws std::exception.
LoadedScenario LoadAnnounced(const std::string& yaml);
// The scenario of a text that WriteResolved() made, with the vehicles that are loaded already. Throws ScenarioError.
Scenario ReadResolvedText(const std::string& yaml, ModelCache& models);

// The scenario with a fault that a user injects while it flies in real time. Throws std::runtime_error with the mistake
// in the fault, or the reason why it cannot act then.
Scenario WithInjected(const Scenario& scenario, const AddedFault& fault);
// Reads it for a flight in lockstep, where every fault can be added that the client can take. `models` may hold the vehicle.
faults::FaultSpec ReadFault(Scenario& scenario, const AddedFault& fault, ModelCache& models);

// MODEL of design-lqr: a name in the models folder, or a path ending in .sdf. Throws UsageError.
std::filesystem::path ResolveModel(const std::string& model);

// The vehicle of such a flag. Throws UsageError.
std::shared_ptr<const plant::VehicleModel> LoadModelFlag(const std::string& model);

// The signals that a formula in the scenario may name.
std::vector<std::string> FormulaSignals(const Scenario& scenario, const VehicleSignals& vehicle);

}  // namespace tiltproof::harness
