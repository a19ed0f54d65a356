// Reads a scenario file into a Scenario: strict, with the place of every error.
//
//   ReadOptions options;
//   options.models_folder = "plant/models";
//   const Scenario scenario = ReadScenario("scenarios/paper/hover.yaml", options);  // throws ScenarioError
//
// docs/scenario.md describes the file.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "harness/scenario/diagnostic.h"
#include "harness/scenario/scenario.h"
#include "harness/scenario/set_keys.h"
#include "link/signal_table.h"

namespace tiltproof::harness {

// The error in a formula. `column` is 1-based, in bytes of its text.
struct FormulaProblem {
  std::size_t column = 1;
  std::string message;
};

// The reason that a protocol does not suit a vehicle, and the first field that the reason is about.
struct ProtocolProblem {
  std::string reason;
  std::string message, signal;  // empty: no field is wrong
};

// The reader's questions to higher layers.
struct ReadOptions {
  // Where `model: name` finds name.sdf.
  std::filesystem::path models_folder;
  // Builds of the firmware that exist; empty: any name is accepted.
  std::vector<std::string> firmware_names;
  // Names a criterion may use as `metric` in a flight with one client; empty: any.
  std::vector<std::string> metric_names;
  // Checks `stl: formula`, which may name signals of the scenario's vehicle and ids of its faults, for its
  // duration (0: unknown); none: not checked.
  std::function<std::optional<FormulaProblem>(std::string_view formula, const Scenario& scenario)>
      check_formula;
  // Checks `when: condition` of a fault in this scenario; none: not checked.
  std::function<std::optional<FormulaProblem>(std::string_view condition, const Scenario& scenario)>
      check_condition;
  // The signals of the scenario's vehicle, nullopt when it cannot be loaded; none: names of signals in faults are not
  // checked.
  std::function<std::optional<VehicleSignals>(const Scenario& scenario)> vehicle_signals;
  // Checks that the model file can be flown, and returns the errors; none: it need only exist.
  std::function<std::optional<std::string>(const std::filesystem::path& model_file,
                                           bool allow_invalid_inertia)>
      check_model;
  // Checks that the scenario's protocol carries the vehicle's signals, and returns the reason that it does not; none:
  // not checked.
  std::function<std::optional<ProtocolProblem>(const Scenario& scenario, const VehicleSignals& vehicle)>
      check_protocol;
};

// Fills in every default and resolves the model's and a recorded reference's file (absolute). Throws
// ScenarioError.
Scenario ReadScenario(const std::filesystem::path& file, const ReadOptions& options);
// The same with other values for some keys. A problem of a setting has a line of SettingOfLine().
Scenario ReadScenarioWith(const std::filesystem::path& file, std::span<const KeySetting> settings,
                          const ReadOptions& options);
// A scenario that was read before, with other values for some keys. Throws ScenarioError in the same way.
Scenario WithSettings(const Scenario& scenario, std::span<const KeySetting> settings,
                      const ReadOptions& options);
// The same for a text from another source; `file` names it in messages.
Scenario ParseScenario(const std::string& text, const std::filesystem::path& file,
                       const ReadOptions& options);

// All scenarios, or a ScenarioError with the problems of all. Two scenarios of one name are a problem.
std::vector<Scenario> ReadScenarios(const std::vector<std::filesystem::path>& files,
                                    const ReadOptions& options);

// A fault that is added while the scenario is flown.
struct AddedFault {
  std::string text;  // an item of `faults`, with duration_s in place of a window, and with or without an id
  std::string id;    // when it has none
  TimeNs start_ns = 0;
};
// Puts that fault behind the scenario's others, in time that hardly depends on their number. Throws ScenarioError, in
// which the text is the file "fault"; the scenario is unchanged then.
void AddFault(Scenario& scenario, const AddedFault& fault, const ReadOptions& options);

// YAML that reads back as an equal scenario, with every default written out and every file absolute.
std::string WriteResolved(const Scenario& scenario);

}  // namespace tiltproof::harness
