#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <memory>
#include <string_view>
#include <vector>

#include "harness/cli/applicability.h"
#include "harness/cli/client_flag.h"
#include "harness/cli/shared_options.h"
#include "harness/cli/suite.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {
namespace {

struct CheckOptions {
  std::vector<std::filesystem::path> paths;
  std::vector<std::string> clients;
  std::string firmware;  // as of RunOptions
};

void PrintWarnings(const Suite& suite) {
  for (const auto& warning : suite.warnings) Print(stderr, "warning: {}\n", warning);
}

// Without --client only problems with any firmware count: which faults are possible depends on the client.
std::vector<NotApplicable> WithoutClient(const RunClients& clients, Suite& suite) {
  std::vector<std::string> problems;
  std::vector<NotApplicable> left_out;
  std::erase_if(suite.scenarios, [&](const SuiteScenario& entry) {
    std::vector<std::string> own = ClientProblems(clients, entry.scenario);
    if (own.empty()) return false;
    if (entry.named)
      problems.insert(problems.end(), own.begin(), own.end());
    else
      left_out.push_back(
          {.name = entry.scenario.name, .reason = fmt::format("{}", fmt::join(own, "; ")), .why = {}});
    return true;
  });
  if (!problems.empty()) throw UsageError(fmt::format("{}", fmt::join(problems, "\n")));
  return left_out;
}

// As `run` does: a scenario that the client cannot fly is a mistake where the user named it.
int CheckCommand(const CheckOptions& options) {
  FlightMeans means;
  means.clients = ReadClientFlags(options.clients);
  const std::vector<ClientSpec> named = means.clients.Named();
  for (const ClientSpec& client : named) CheckFirmwareFile(client);
  // A client without virtual time flies in real time only.
  means.realtime = std::any_of(named.begin(), named.end(), [](const ClientSpec& client) {
    return !AbilitiesOf(client, false).virtual_time;
  });
  Suite suite = LoadSuite(options.paths, means.clients, options.firmware);
  PrintWarnings(suite);
  const std::vector<NotApplicable> left_out = options.clients.empty()
                                                  ? WithoutClient(means.clients, suite)
                                                  : RemoveNotApplicable(means, false, suite);
  for (const NotApplicable& other : left_out)
    Print(stderr, "not applicable: {}: {}\n", other.name, other.reason);
  const std::size_t count = suite.scenarios.size();
  Print(stdout, "{} scenario{} in order{}\n", count, count == 1 ? "" : "s",
        left_out.empty() ? "" : fmt::format(", {} not applicable", left_out.size()));
  return count == 0 ? kExitUndecided : kExitGreen;
}

int ListCommand(const CheckOptions& options) {
  const Suite suite = LoadSuite(options.paths, ReadClientFlags(options.clients), options.firmware);
  PrintWarnings(suite);
  std::size_t name_width = 0, model_width = 0, firmware_width = 0;
  for (const auto& [scenario, model, named, settings] : suite.scenarios) {
    name_width = std::max(name_width, scenario.name.size());
    model_width = std::max(model_width, scenario.model.size());
    firmware_width = std::max(firmware_width, scenario.firmware.size());
  }
  for (const auto& [scenario, model, named, settings] : suite.scenarios) {
    std::vector<std::string_view> faults;
    for (const auto& fault : scenario.faults) faults.push_back(fault.type);
    Print(stdout, "{:<{}}  {:>5.0f} s  {:<{}}  {:<{}}  expect {:<12}  [{}]  {}\n", scenario.name, name_width,
          ToSeconds(scenario.duration_ns), scenario.model, model_width, scenario.firmware, firmware_width,
          Name(scenario.expected()), fmt::format("{}", fmt::join(scenario.tags, ", ")),
          fmt::format("{}", fmt::join(faults, ", ")));
  }
  return suite.scenarios.empty() ? kExitUndecided : kExitGreen;
}

// The signals that formulas of these scenarios may name; without a path, those of a flight of the shipped vehicle.
int SignalsCommand(const CheckOptions& options) {
  std::vector<std::string> names;
  const auto add = [&names](const Scenario& scenario, const plant::VehicleModel& model) {
    for (std::string& name : FormulaSignals(scenario, model.signals()))
      if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(std::move(name));
  };
  if (options.paths.empty()) {
    std::vector<std::string> warnings;
    add(Scenario{}, plant::LoadVehicle(ResolveModel(Scenario().model), {}, warnings));
  } else {
    const Suite suite = LoadSuite(options.paths, ReadClientFlags(options.clients), options.firmware);
    PrintWarnings(suite);
    for (const auto& [scenario, model, named, settings] : suite.scenarios) add(scenario, *model);
  }
  for (const std::string& name : names) Print(stdout, "{}\n", name);
  return names.empty() ? kExitUndecided : kExitGreen;
}

void AddScenarioClients(CLI::App& command, CheckOptions& options) {
  AddClients(command, options.clients, "It says what `firmware` may be.");
  AddFirmware(command, options.firmware);
}

void RegisterList(CLI::App& program, CommandLine& line) {
  const auto options = std::make_shared<CheckOptions>();
  const auto lists_signals = std::make_shared<bool>(false);
  CLI::App* command = program.add_subcommand("list", "List scenarios");
  CLI::Option* path = command->add_option("PATH", options->paths, "Scenario files, or folders of them");
  command->add_flag(
      "--signals", *lists_signals,
      "The signals that formulas may name there, one per line; without PATH, those of a flight of the "
      "shipped vehicle");
  AddScenarioClients(*command, *options);
  command->callback([options, lists_signals, path, &line] {
    if (!*lists_signals && options->paths.empty()) throw CLI::RequiredError(path->get_name());
    line.action = [options, lists_signals] {
      return *lists_signals ? SignalsCommand(*options) : ListCommand(*options);
    };
  });
}

}  // namespace

void RegisterCheck(CLI::App& program, CommandLine& line) {
  const auto options = std::make_shared<CheckOptions>();
  CLI::App* command = program.add_subcommand(
      "check", "Check scenario files, their models, formulas and faults, without flying");
  command->add_option("PATH", options->paths, "Scenario files, or folders of them")->required();
  AddScenarioClients(*command, *options);
  SetAction(*command, line, [options] { return CheckCommand(*options); });
  RegisterList(program, line);
}

}  // namespace tiltproof::harness
