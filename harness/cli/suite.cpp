#include "harness/cli/suite.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <span>
#include <stdexcept>

#include "faults/registry.h"
#include "harness/cli/client_flag.h"
#include "harness/cli/commands.h"
#include "harness/cli/data_files.h"
#include "harness/cli/range_warnings.h"
#include "harness/client/make_client.h"
#include "harness/run/client_parameters.h"
#include "harness/run/fault_conditions.h"
#include "harness/run/message_binding.h"
#include "harness/run/supervisor_states.h"
#include "harness/run/vehicle_start.h"
#include "harness/scenario/did_you_mean.h"
#include "harness/scenario/model_path.h"
#include "harness/scenario/selection.h"
#include "harness/scenario/shipped_protocols.h"
#include "harness/score/score.h"
#include "harness/score/signals.h"
#include "harness/score/stl.h"
#include "plant/plant.h"

namespace tiltproof::harness {
namespace {

std::optional<FormulaProblem> CheckFormula(std::string_view text, const Scenario& scenario,
                                           const VehicleSignals& vehicle) {
  const std::vector<std::string> signals = FormulaSignals(scenario, vehicle);
  std::vector<std::string> fault_ids;
  for (const auto& fault : scenario.faults) fault_ids.push_back(fault.id);
  const TimeNs duration_ns = scenario.duration_ns;
  try {
    const TimeNs decided_ns =
        stl::EarliestDecision(stl::Parse(text, {.signals = signals, .fault_ids = fault_ids}), duration_ns);
    if (duration_ns == 0 || decided_ns <= duration_ns) return std::nullopt;
    return FormulaProblem{
        1, fmt::format("can be decided at {:g} s at the earliest, and the flight ends at {:g} s "
                       "(duration_s)",
                       ToSeconds(decided_ns), ToSeconds(duration_ns))};
  } catch (const stl::ParseError& error) {
    return FormulaProblem{error.column, error.what()};
  }
}

std::optional<FormulaProblem> CheckCondition(std::string_view text, const Scenario& scenario,
                                             const VehicleSignals& vehicle) {
  const Trace trace(TraceLayout(vehicle, scenario).columns);
  try {
    const stl::Condition condition(text, FaultConditions::SignalNames(trace.columns()));
    return std::nullopt;
  } catch (const stl::ParseError& error) {
    return FormulaProblem{error.column, error.what()};
  }
}

// A model that cannot be loaded has its own message.
decltype(ReadOptions::vehicle_signals) SignalsFrom(ModelCache& models) {
  return [&models](const Scenario& scenario) -> std::optional<VehicleSignals> {
    try {
      return models.Load(scenario.model_file, scenario.allow_invalid_inertia)->signals();
    } catch (const std::exception&) {
      return std::nullopt;
    }
  };
}

// Enough for one more fault.
ReadOptions FaultReadOptions(ModelCache& models) {
  ReadOptions options;
  options.vehicle_signals = SignalsFrom(models);
  return options;
}

ReadOptions MakeReadOptions(ModelCache& models) {
  ReadOptions options;
  options.models_folder = ModelsFolder();
  options.metric_names = MetricNames();
  options.vehicle_signals = SignalsFrom(models);
  const auto with_vehicle = [signals = options.vehicle_signals](const auto& check) {
    return
        [signals, check](std::string_view text, const Scenario& scenario) -> std::optional<FormulaProblem> {
          const std::optional<VehicleSignals> vehicle = signals(scenario);
          return vehicle ? check(text, scenario, *vehicle) : std::nullopt;
        };
  };
  options.check_formula = with_vehicle(CheckFormula);
  options.check_condition = with_vehicle(CheckCondition);
  options.check_model = [&models](const std::filesystem::path& file,
                                  bool allow_invalid_inertia) -> std::optional<std::string> {
    try {
      models.Load(file, allow_invalid_inertia);
      return std::nullopt;
    } catch (const std::exception& error) {
      return error.what();
    }
  };
  options.check_protocol = [](const Scenario& scenario,
                              const VehicleSignals& vehicle) -> std::optional<ProtocolProblem> {
    ProtocolField field;
    ProtocolProblem problem;
    problem.reason = UnsuitableProtocol(*scenario.link.protocol, vehicle, &field);
    if (problem.reason.empty()) return std::nullopt;
    if (field.first != nullptr) {
      problem.message = field.first->name;
      problem.signal = field.second->signal;
    }
    if (FindProtocol(scenario.link.protocol->name) != nullptr)
      problem.reason +=
          ". It is made for two rotors, each on a hinge of its own, that the vehicle's file names 'right' "
          "and 'left'; the protocol 'paper' carries the signals of any vehicle (docs/vehicle.md)";
    return problem;
  };
  return options;
}

// The reason that no firmware survives the start; empty when one can.
std::string StartProblem(const Scenario& scenario, const plant::VehicleModel& model) {
  plant::Plant plant(model, PlantOptionsOf(scenario));
  PlaceAtStart(scenario, plant);
  constexpr double kDepthMax_m = 1e-6;
  if (const double depth_m = -plant.Clearance_m(); scenario.solid_ground && depth_m > kDepthMax_m)
    return fmt::format(
        "{}: initial: the vehicle would start {:.4g} m deep in the ground: `on_ground: true` starts it on "
        "the "
        "ground, and from position_m[2] = {:.4g} on it starts above it",
        scenario.file.string(), depth_m, scenario.initial_position_m[2] + depth_m);
  if (plant.Event() == plant::FlightEvent::kNone) return {};
  return fmt::format("{}: initial: the flight would end where it starts: {}", scenario.file.string(),
                     plant.EventText());
}

// The build `lqr`, and a library that takes parameters, need a gain. The reason that a client has none for the
// vehicle; empty when it has one. `shipped`: the build is one of tiltproof's own.
std::string BuildProblem(const Scenario& scenario, const plant::VehicleModel& model, std::size_t client,
                         bool shipped) {
  const auto problem = [&](std::string_view key, std::string_view why) {
    return fmt::format("{}: {}: {}", scenario.file.string(), key, why);
  };
  if (scenario.firmware_of(client) != kLqrBuild && shipped) return {};  // applicability.h
  if (scenario.firmware_of(client) == kLqrBuild)
    if (const auto missing = StatesNotCarried(*scenario.link.protocol, model.signals()); !missing.empty())
      return problem(
          "firmware",
          fmt::format("lqr: the protocol '{}' does not carry {}, which its law needs; roll, pitch and yaw "
                      "may come from quaternion_w, _x, _y and _z, and the angular rates from gyro_x_rad_s, "
                      "gyro_y_rad_s and gyro_z_rad_s",
                      scenario.link.protocol->name, fmt::join(missing, ", ")));
  try {
    // Designed here once, and known in the processes of all flights.
    GainOf(scenario, model);
    return {};
  } catch (const plant::DesignError& error) {
    if (!shipped && scenario.gain_file.empty()) return {};
    if (scenario.gain_file.empty())
      return problem("firmware", fmt::format("lqr: {}: {}", model.file.string(), error.what()));
    return problem("gain", error.what());
  }
}

}  // namespace

std::vector<std::string> FormulaSignals(const Scenario& scenario, const VehicleSignals& vehicle) {
  std::vector<std::string> columns = Trace(TraceLayout(vehicle, scenario).columns).columns();
  for (std::size_t i = 0; i < scenario.client_count(); ++i)
    columns.push_back(SupervisorStateColumn(scenario, i));
  for (std::size_t i = 0; scenario.has_several_clients() && i < scenario.client_count(); ++i)
    columns.push_back(RoleColumn(scenario, i));
  return SignalNames(columns);
}

void ModelCache::Add(const Scenario& scenario, std::shared_ptr<const plant::VehicleModel> model) {
  entries_.push_back({scenario.model_file, scenario.allow_invalid_inertia, std::move(model)});
}

std::shared_ptr<const plant::VehicleModel> ModelCache::Load(const std::filesystem::path& file,
                                                            bool allow_invalid_inertia) {
  for (const auto& entry : entries_)
    if (entry.file == file && entry.allow_invalid_inertia == allow_invalid_inertia) return entry.model;
  std::vector<std::string> warnings;
  plant::LoadOptions options;
  options.allow_invalid_inertia = allow_invalid_inertia;
  auto model = std::make_shared<const plant::VehicleModel>(plant::LoadVehicle(file, options, warnings));
  for (auto& warning : warnings)
    if (std::find(warnings_.begin(), warnings_.end(), warning) == warnings_.end())
      warnings_.push_back(std::move(warning));
  entries_.push_back({file, allow_invalid_inertia, model});
  return model;
}

std::span<const std::string_view> BuildsOfClients(const RunClients& clients) {
  const auto named = clients.Named();
  const bool shipped = std::all_of(named.begin(), named.end(), [](const ClientSpec& client) {
    return AbilitiesOf(client, false).shipped;
  });
  return shipped ? std::span<const std::string_view>(kShippedBuilds) : std::span<const std::string_view>();
}

void CheckBuild(const std::string& build) {
  if (std::find(kShippedBuilds.begin(), kShippedBuilds.end(), build) != kShippedBuilds.end()) return;
  const std::string_view other =
      ClosestName(build, kShippedBuilds).empty() ? "; --client flies a firmware of your own" : "";
  throw UsageError(
      fmt::format("--firmware {}: no such build{}{}", build, DidYouMean(build, kShippedBuilds), other));
}

namespace {

// True if frames of the protocol may have bytes above 7F.
bool NeedsEightBits(const link::Protocol& protocol) {
  for (const link::MessageType& type : protocol.messages) {
    for (const link::MessageField& field : type.fields)
      if (link::NumberBytes(field.type) > 1 || field.min < 0 || field.max / field.scale > 0x7F) return true;
    for (unsigned value = 0; value <= 0x7F; ++value) {
      const std::vector<std::uint8_t> payload(type.payload_bytes, static_cast<std::uint8_t>(value));
      const auto frame = protocol.framing->Encode(payload);
      if (std::any_of(frame.begin(), frame.end(), [](std::uint8_t byte) { return byte > 0x7F; })) return true;
    }
  }
  return false;
}

// A warning about the line; empty: there is none.
std::string LineWarning(const Scenario& scenario) {
  if (scenario.link.character.data_bits == 8 || !NeedsEightBits(*scenario.link.protocol)) return "";
  return fmt::format(
      "{}: link.data_bits: 7: every byte loses its top bit, and protocol '{}' needs it; no frame with such a "
      "byte "
      "will arrive whole. Write `data_bits: 8`",
      scenario.file.string(), scenario.link.protocol->name);
}

}  // namespace

namespace {

ReadOptions SuiteReadOptions(ModelCache& models, const RunClients& clients) {
  ReadOptions options = MakeReadOptions(models);
  const std::span<const std::string_view> builds = BuildsOfClients(clients);
  options.firmware_names.assign(builds.begin(), builds.end());
  return options;
}

// The reasons that the scenario cannot be flown.
std::vector<std::string> ProblemsOf(const Scenario& scenario, const plant::VehicleModel& model,
                                    const RunClients& clients) {
  std::vector<std::string> problems = {StartProblem(scenario, model)};
  for (std::size_t client = 0; client < scenario.client_count(); ++client)
    problems.push_back(BuildProblem(scenario, model, client,
                                    AbilitiesOf(clients.Of(scenario.client_id(client)), false).shipped));
  std::erase(problems, "");
  return problems;
}

// The flags in place of the lines that stand for them.
[[noreturn]] void ThrowOfSettings(const ScenarioError& error, const std::vector<KeySetting>& settings) {
  std::vector<std::string> problems;
  for (const Diagnostic& problem : error.diagnostics()) {
    const std::optional<std::size_t> setting = SettingOfLine(problem.line);
    if (setting)
      problems.push_back(fmt::format("--set {}: {} ({})", ToText(settings.at(*setting)), problem.message,
                                     problem.file.string()));
    else
      problems.push_back(fmt::format("{}, with --set {}", ToString(problem), ToText(settings.front())));
  }
  throw UsageError(fmt::format("{}", fmt::join(problems, "\n")));
}

std::runtime_error CannotBegin(const faults::FaultSpec& fault) {
  return std::runtime_error(
      fmt::format("{} cannot be injected: only faults on the wire, its frames, sensors, actuators and the "
                  "plant can begin while a flight goes on; put it into the scenario",
                  fault.type));
}

}  // namespace

Suite LoadSuite(const std::vector<std::filesystem::path>& paths, const RunClients& clients,
                const std::string& build) {
  ModelCache models;
  const ReadOptions options = SuiteReadOptions(models, clients);
  if (!options.firmware_names.empty() && !build.empty()) CheckBuild(build);
  if (build.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789_") != std::string::npos)
    throw UsageError(fmt::format("--firmware {}: must be lower-case letters, digits and '_'", build));
  const FoundScenarios found = FindScenarios(paths);
  std::vector<std::string> problems = found.problems;
  std::vector<Scenario> scenarios;
  try {
    scenarios = ReadScenarios(found.Paths(), options);
  } catch (const ScenarioError& error) {
    problems.emplace_back(error.what());
  }
  if (!problems.empty()) throw UsageError(fmt::format("{}", fmt::join(problems, "\n")));
  Suite suite;
  for (std::size_t i = 0; i < scenarios.size(); ++i) {
    if (!build.empty()) scenarios[i].FlyFirmware(build);
    auto model = models.Load(scenarios[i].model_file, scenarios[i].allow_invalid_inertia);
    for (std::string& problem : ProblemsOf(scenarios[i], *model, clients))
      problems.push_back(std::move(problem));
    suite.scenarios.push_back({std::move(scenarios[i]), std::move(model), found.files[i].named, {}});
  }
  if (!problems.empty()) throw UsageError(fmt::format("{}", fmt::join(problems, "\n")));
  std::vector<const Scenario*> all;
  for (const auto& entry : suite.scenarios) all.push_back(&entry.scenario);
  CheckClientIds(clients, all);
  suite.name = SuiteName(paths);
  suite.warnings = found.warnings;
  suite.warnings.insert(suite.warnings.end(), models.warnings().begin(), models.warnings().end());
  for (const auto& entry : suite.scenarios) {
    if (std::string warning = LineWarning(entry.scenario); !warning.empty())
      suite.warnings.push_back(std::move(warning));
    std::vector<std::string> beyond = RangeWarnings(entry.scenario, *entry.model);
    std::move(beyond.begin(), beyond.end(), std::back_inserter(suite.warnings));
  }
  return suite;
}

void Sweep(const std::vector<SweepAxis>& sweep, const RunClients& clients, const std::string& build,
           Suite& suite) {
  if (sweep.empty()) return;
  ModelCache models;
  const ReadOptions options = SuiteReadOptions(models, clients);
  const std::vector<std::vector<KeySetting>> cells = CellsOf(sweep);
  std::vector<SuiteScenario> swept;
  for (const SuiteScenario& entry : suite.scenarios) {
    const std::vector<std::string> names = CellNames(entry.scenario.name, cells);
    for (std::size_t i = 0; i < cells.size(); ++i) {
      SuiteScenario& cell = swept.emplace_back();
      try {
        cell.scenario = ReadScenarioWith(entry.scenario.file, cells[i], options);
      } catch (const ScenarioError& error) {
        ThrowOfSettings(error, cells[i]);
      }
      cell.scenario.name = names[i];
      if (!build.empty()) cell.scenario.FlyFirmware(build);
      cell.model = models.Load(cell.scenario.model_file, cell.scenario.allow_invalid_inertia);
      cell.named = entry.named;
      cell.settings = cells[i];
      if (const auto problems = ProblemsOf(cell.scenario, *cell.model, clients); !problems.empty())
        throw UsageError(fmt::format("{}, with --set {}", problems.front(), ToText(cells[i].front())));
    }
  }
  suite.scenarios = std::move(swept);
}

Scenario WithKey(const Scenario& scenario, const KeySetting& setting, ModelCache& models) {
  try {
    return WithSettings(scenario, std::span(&setting, 1), MakeReadOptions(models));
  } catch (const ScenarioError& error) {
    throw std::runtime_error(error.diagnostics().front().message);
  }
}

LoadedScenario LoadFlown(const std::filesystem::path& scenario_folder) {
  ModelCache models;
  return LoadFlown(scenario_folder, models);
}

LoadedScenario LoadFlown(const std::filesystem::path& scenario_folder, ModelCache& models) {
  try {
    Scenario scenario = ReadScenario(scenario_folder / "scenario.resolved.yaml", MakeReadOptions(models));
    auto model = models.Load(scenario.model_file, scenario.allow_invalid_inertia);
    return {std::move(scenario), std::move(model)};
  } catch (const ScenarioError& error) {
    throw UsageError(error.what());
  }
}

Scenario ReadResolvedText(const std::string& yaml, ModelCache& models) {
  return ParseScenario(yaml, "announced scenario", MakeReadOptions(models));
}

LoadedScenario LoadAnnounced(const std::string& yaml) {
  ModelCache models;
  Scenario scenario = ReadResolvedText(yaml, models);
  auto model = models.Load(scenario.model_file, scenario.allow_invalid_inertia);
  return {std::move(scenario), std::move(model)};
}

Scenario WithInjected(const Scenario& scenario, const AddedFault& fault) {
  ModelCache models;
  Scenario more = scenario;
  AddFault(more, fault, FaultReadOptions(models));
  const faults::FaultType& type = *faults::FindFaultType(more.faults.back().type);
  if (type.is_command() || type.IsOneOf<faults::ReceiverKind>()) throw CannotBegin(more.faults.back());
  return more;
}

faults::FaultSpec ReadFault(Scenario& scenario, const AddedFault& fault, ModelCache& models) {
  AddFault(scenario, fault, FaultReadOptions(models));
  faults::FaultSpec read = std::move(scenario.faults.back());
  scenario.faults.pop_back();
  scenario.fault_places.pop_back();
  return read;
}

std::shared_ptr<const plant::VehicleModel> LoadModelFlag(const std::string& model) {
  try {
    return ModelCache().Load(ResolveModel(model), true);
  } catch (const plant::VehicleError& error) {
    throw UsageError(error.what());
  }
}

std::filesystem::path ResolveModel(const std::string& model) {
  const std::filesystem::path file =
      IsModelPath(model) ? std::filesystem::path(model) : ModelsFolder() / (model + ".sdf");
  if (std::filesystem::is_regular_file(file)) return std::filesystem::absolute(file);
  std::vector<std::string> names;
  std::error_code no_folder;  // of a program that was copied away from its files
  for (const auto& entry : std::filesystem::directory_iterator(ModelsFolder(), no_folder))
    if (entry.path().extension() == ".sdf") names.push_back(entry.path().stem());
  std::sort(names.begin(), names.end());
  throw UsageError(fmt::format("MODEL {}: no file {}; give a path ending in .sdf, or one of: {}", model,
                               file.string(), fmt::join(names, ", ")));
}

}  // namespace tiltproof::harness
