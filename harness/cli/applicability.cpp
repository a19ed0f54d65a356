#include "harness/cli/applicability.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>

#include "faults/device_command.h"
#include "faults/registry.h"
#include "faults/signal_choice.h"
#include "harness/cli/commands.h"
#include "harness/client/firmware_files.h"
#include "harness/client/library_client.h"
#include "harness/client/make_client.h"
#include "harness/emulator/diagnosis/watched_variable.h"
#include "harness/emulator/elf_symbols.h"
#include "harness/emulator/image_check.h"
#include "harness/reference/trajectory.h"
#include "harness/run/client_channel.h"
#include "harness/run/supervisor_states.h"
#include "harness/scenario/fault_support.h"
#include "harness/scenario/protocol_file.h"
#include "harness/scenario/shipped_protocols.h"

namespace tiltproof::harness {
namespace {

// The memory that the scenario's faults flip and a client's image lacks.
void FindMissingRegions(const ElfSymbols& image, const Scenario& scenario, std::size_t client,
                        std::vector<Problem>& problems) {
  for (const faults::DeviceCommand& command : ClientCommands(scenario, client)) {
    const auto* flips = std::get_if<faults::FlipBits>(&command.action);
    if (flips == nullptr) continue;
    try {
      faults::DrawBitFlips(*flips, image.Region(flips->region).size_bytes);
    } catch (const std::exception& error) {
      problems.push_back(
          {fmt::format("{}: {}", FaultPlace(scenario, command.fault), error.what()), error.what()});
    }
  }
}

// The reason that a variable cannot be watched; "" when it can. `image`: empty for a client without one.
std::string WhyUnwatchable(const std::string& variable, const ClientSpec& client,
                           const std::filesystem::path& image, bool realtime) {
  if (image.empty())
    return fmt::format(
        "'{}': the client {} has no image whose variables could be read; fly it with --client qemu", variable,
        ToText(client));
  if (realtime)
    return fmt::format("'{}': only in lockstep: in real time the variables change while they are read",
                       variable);
  try {
    FindVariable(image, variable);
    return "";
  } catch (const std::runtime_error& error) {
    return error.what();
  }
}

// Place of a line among those of the client.
std::size_t PlaceOfLine(const Scenario& scenario, const std::string& client, std::size_t line) {
  const std::vector<LineEndId> ends = scenario.line_ends_of(scenario.FindClient(client).value());
  const auto end =
      std::find_if(ends.begin(), ends.end(), [&](const LineEndId& each) { return each.line == line; });
  return static_cast<std::size_t>(end - ends.begin());
}

// The lines to other boards that the client's text names.
std::vector<std::string> NamedLines(const ClientSpec& client) {
  std::vector<std::string> lines;
  if (const auto* image = std::get_if<EmulatedImage>(&client))
    for (const auto& named : image->line_usarts) lines.push_back(named.first);
  if (const auto* board = std::get_if<SerialBoard>(&client))
    for (const auto& named : board->line_devices) lines.push_back(named.first);
  return lines;
}

// Lines between boards that the clients cannot have.
void FindUnconnectedLines(const Scenario& scenario, const std::vector<ClientSpec>& clients, bool realtime,
                          std::vector<Problem>& problems) {
  for (std::size_t line = 0; line < scenario.lines.size(); ++line) {
    const LineEntry& entry = scenario.lines[line];
    const auto complain = [&](const std::string& why) {
      const std::string& place =
          line < scenario.line_places.size() ? scenario.line_places[line] : scenario.name;
      const std::string text = fmt::format("lines: '{}': {}", entry.id, why);
      problems.push_back({fmt::format("{}: {}", place, text), text});
    };
    for (const std::string& id : entry.between) {
      const ClientSpec& client = clients.at(scenario.FindClient(id).value());
      const auto* image = std::get_if<EmulatedImage>(&client);
      const auto* program = std::get_if<LockstepProgram>(&client);
      if (image != nullptr && !LineUsart(*image, entry.id, PlaceOfLine(scenario, id, line)))
        complain(fmt::format("the image of client '{}' has no USART for it: add ,{}=usartN to --client", id,
                             entry.id));
      const auto* board = std::get_if<SerialBoard>(&client);
      if (board != nullptr && realtime && !board->line_devices.contains(entry.id))
        complain(fmt::format("the board of client '{}' has no device for it: add ,{}=DEV to --client", id,
                             entry.id));
      if (program != nullptr && program->clocked)
        complain(
            fmt::format("client '{}' is a program under a virtual clock, which has two ports only; use "
                        "program:CMD or a library",
                        id));
    }
  }
  for (std::size_t i = 0; i < clients.size(); ++i) {
    const std::vector<LineEndId> ends = scenario.line_ends_of(i);
    for (const std::string& line : NamedLines(clients[i])) {
      if (std::none_of(ends.begin(), ends.end(),
                       [&](const LineEndId& end) { return scenario.lines[end.line].id == line; })) {
        const std::string why =
            fmt::format("--client {}: the client '{}' has no line '{}' in the scenario {}",
                        ToText(clients[i]), scenario.client_id(i), line, scenario.name);
        problems.push_back({why, why});
      }
    }
  }
}

// Adds those of the scenario. Throws UsageError for one that the user named on the command line.
void FindUnwatchable(const Scenario& scenario, const ClientSpec& client, const std::filesystem::path& image,
                     bool realtime, std::vector<Problem>& problems) {
  for (std::size_t i = 0; i < scenario.watch.size(); ++i) {
    const std::string why = WhyUnwatchable(scenario.watch[i], client, image, realtime);
    if (why.empty()) continue;
    if (i >= scenario.watch_places.size()) throw UsageError("--watch: " + why);
    problems.push_back({fmt::format("{}: watch: {}", scenario.watch_places[i], why), "watch: " + why});
  }
}

// The laws of the shipped firmware are linear around a heading of 0 (paper, section 3): with both builds the vehicle diverges
// at larger ones (docs/scenario.md).
constexpr double kShippedHeadingMax_rad = 0.55;

void FindLargeHeading(const Scenario& scenario, std::size_t client, std::vector<Problem>& problems) {
  if (scenario.firmware_of(client) == kLqrBuild) return;  // flies at any heading
  const auto complain = [&](const char* key, double heading_rad) {
    const std::string why = fmt::format(
        "the law of the shipped firmware ({}) is linear around 0 and keeps the vehicle up to {} rad: turn "
        "the "
        "scenario's path, or fly your own firmware (--client)",
        scenario.firmware_of(client), kShippedHeadingMax_rad);
    problems.push_back(
        {fmt::format("{}: {}: a heading of {:.3g} rad; {}", scenario.file.string(), key, heading_rad, why),
         "turns far from a heading of 0; " + why});
  };
  if (std::abs(scenario.initial_attitude_rad[2]) > kShippedHeadingMax_rad)
    return complain("initial: attitude_rad", scenario.initial_attitude_rad[2]);
  const Trajectory trajectory(scenario.reference);
  for (TimeNs t = 0; t <= scenario.duration_ns; t += scenario.link.protocol->control_period_ns)
    if (const double yaw_rad = trajectory.At(t).yaw_rad; std::abs(yaw_rad) > kShippedHeadingMax_rad)
      return complain("reference", yaw_rad);
}

// The other builds hold the gain of the tilt-rotor: the messages of any other vehicle are not theirs.
void FindOtherVehicle(const Scenario& scenario, std::size_t client, std::vector<Problem>& problems) {
  const std::string& build = scenario.firmware_of(client);
  const link::Protocol& protocol = *scenario.link.protocol;
  const auto known = FindProtocol(DialectOf(protocol));
  if (build == kLqrBuild || (known && SameOnTheLine(protocol, *known))) return;
  const std::string why = known == nullptr
                              ? fmt::format("the build '{}' does not speak the protocol '{}'; it speaks {}",
                                            build, protocol.name, fmt::join(ShippedProtocolNames(), ", "))
                              : fmt::format(
                                    "the build '{}' holds the gain of the tilt-rotor and cannot fly the "
                                    "vehicle of {}; `firmware: lqr` "
                                    "flies "
                                    "any vehicle",
                                    build, scenario.model_file.string());
  problems.push_back({fmt::format("{}: firmware: {}", scenario.file.string(), why), why});
}

// The other builds hold numbers of their own, and an image has no parameters.
bool TakesNumbers(const ClientSpec& client, const std::string& build) {
  if (AbilitiesOf(client, false).shipped) return build == kLqrBuild;
  return !std::holds_alternative<EmulatedImage>(client) && !std::holds_alternative<SerialBoard>(client);
}

// For messages; `build` counts for a shipped one.
std::string NameOf(const ClientSpec& client, const std::string& build) {
  return AbilitiesOf(client, false).shipped ? fmt::format("the build '{}'", build)
                                            : fmt::format("the client {}", ToText(client));
}

void AddKeyProblem(const Scenario& scenario, const char* key, const std::string& why,
                   std::vector<Problem>& problems) {
  problems.push_back(
      {fmt::format("{}: {}: {}", scenario.file.string(), key, why), fmt::format("{}: {}", key, why)});
}

void FindUnusedGain(const Scenario& scenario, const std::vector<ClientSpec>& clients,
                    std::vector<Problem>& problems) {
  if (scenario.gain.empty()) return;
  for (std::size_t i = 0; i < clients.size(); ++i)
    if (TakesNumbers(clients[i], scenario.firmware_of(i))) return;
  AddKeyProblem(
      scenario, "gain",
      fmt::format("{} does not take a gain; `firmware: lqr` does, and so do a library (library:FILE) and "
                  "a program (program:CMD, process:CMD) of your own",
                  NameOf(clients.front(), scenario.firmware_of(0))),
      problems);
}

// The only number that the build lqr takes: the time of one step of its law. Its largest value.
constexpr std::string_view kComputeParameter = "compute_us";
constexpr int kComputeMax_us = 1'000'000;

void FindUnusedNumbers(const Scenario& scenario, const std::vector<ClientSpec>& clients,
                       std::vector<Problem>& problems) {
  if (scenario.firmware_parameters.empty()) return;
  constexpr const char* kKey = "firmware_parameters";
  bool taken = false;
  for (std::size_t i = 0; i < clients.size(); ++i) {
    if (!TakesNumbers(clients[i], scenario.firmware_of(i))) continue;
    taken = true;
    if (!AbilitiesOf(clients[i], false).shipped) continue;
    for (const FirmwareParameter& parameter : scenario.firmware_parameters) {
      if (parameter.name == kComputeParameter && parameter.value >= 0 && parameter.value <= kComputeMax_us)
        continue;
      return AddKeyProblem(
          scenario, kKey,
          fmt::format("the build lqr takes {}, the time of one step of its law, from 0 to {}; "
                      "here is {}: {}",
                      kComputeParameter, kComputeMax_us, parameter.name, parameter.value),
          problems);
    }
  }
  if (taken) return;
  AddKeyProblem(
      scenario, kKey,
      fmt::format("{} takes no numbers; `firmware: lqr` takes {}, and a library (library:FILE) or a "
                  "program (program:CMD, process:CMD) of your own takes what it knows",
                  NameOf(clients.front(), scenario.firmware_of(0)), kComputeParameter),
      problems);
}

// device.slow_cpu on a shipped build that states no computing time.
void FindUnstatedComputing(const Scenario& scenario, const std::vector<ClientSpec>& clients,
                           std::vector<Problem>& problems) {
  for (std::size_t fault = 0; fault < scenario.faults.size(); ++fault) {
    const faults::FaultSpec& spec = scenario.faults[fault];
    const faults::FaultType* type = faults::FindFaultType(spec.type);
    if (type == nullptr || type->needs != faults::Needs::kComputing) continue;
    for (std::size_t i = 0; i < clients.size(); ++i) {
      if (!spec.client.empty() && spec.client != scenario.client_id(i)) continue;
      if (!std::holds_alternative<HostLibrary>(clients[i]) || !AbilitiesOf(clients[i], false).shipped)
        continue;
      const auto& numbers = scenario.firmware_parameters;
      const bool states = std::any_of(numbers.begin(), numbers.end(), [](const FirmwareParameter& number) {
        return number.name == kComputeParameter && number.value > 0;
      });
      if (states && scenario.firmware_of(i) == kLqrBuild) continue;
      const std::string why = fmt::format(
          "stretches the computing time that a firmware states, and the build '{}' states none here: give "
          "`firmware: lqr` a number {} among `firmware_parameters`, or fly your own firmware",
          scenario.firmware_of(i), kComputeParameter);
      problems.push_back({fmt::format("{} {}", FaultPlace(scenario, fault), why), why});
      break;
    }
  }
}

// True if a formula has this word outside texts in quotes.
bool HasWord(std::string_view formula, std::string_view word) {
  constexpr std::string_view kLetters = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_";
  for (std::size_t at = 0; at < formula.size();) {
    const std::size_t end = std::min(formula.find_first_not_of(kLetters, at), formula.size());
    if (formula.substr(at, end - at) == word) return true;
    if (end < formula.size() && formula[end] == '"')
      at = std::min(formula.find('"', end + 1), formula.size() - 1) + 1;
    else
      at = end + 1;
  }
  return false;
}

// Reads each image once.
class Images {
 public:
  // Throws UsageError when there is none that can be read.
  const ElfSymbols& Read(const EmulatedImage& image, const std::string& firmware,
                         const link::Protocol& protocol) {
    const std::filesystem::path file = BoardOf(image, firmware, protocol).image;
    if (image.file.empty() && firmware == kLqrBuild)
      throw UsageError(fmt::format(
          "--client {}: there is no image of the build lqr, because an image has no vehicle's parameters; "
          "fly it with --client host, or put the header of `design-lqr --header` into your own image",
          ToText(image)));
    if (image.file.empty() && image.scheduler == "freertos" &&
        (firmware == "failover" || firmware == "triplex"))
      throw UsageError(
          fmt::format("--client {}: the build {} has no image under FreeRTOS; fly it with --client qemu",
                      ToText(image), firmware));
    if (!std::filesystem::is_regular_file(file))
      throw UsageError(fmt::format("--client {}: no image at {}{}", ToText(image), file.string(),
                                   !image.file.empty() ? ""
                                   : image.scheduler == "freertos"
                                       ? ": it is built where FREERTOS_KERNEL_PATH names a FreeRTOS kernel, "
                                         "or `./setup --freertos` has fetched one"
                                       : ": " + HowToGetImages()));
    if (const auto known = images_.find(file); known != images_.end()) return known->second;
    try {
      CheckImage(file);
      return images_.try_emplace(file, file).first->second;
    } catch (const std::runtime_error& error) {
      throw UsageError(fmt::format("--client {}: {}", ToText(image), error.what()));
    }
  }

 private:
  std::map<std::filesystem::path, ElfSymbols> images_;
};

}  // namespace

namespace {

// Reports of a client on itself, and the ways to make them.
struct Told {
  std::string_view symbol, function;
  bool (*by_library)(const std::filesystem::path&);
  std::string_view noun;
};
constexpr Told kToldState = {kStatusSymbol, "tiltproof_client_status", TellsStatus, "state"};
constexpr Told kToldRole = {kRoleSymbol, "tiltproof_client_role", TellsRole, "role"};

// Reason that this client does not tell it; empty: it does.
std::string WhyUntold(const Told& told, const Scenario& scenario, std::size_t client, const ClientSpec& spec,
                      Images& images) {
  const std::string& firmware = scenario.firmware_of(client);
  if (const auto* image = std::get_if<EmulatedImage>(&spec)) {
    if (images.Read(*image, firmware, *scenario.link.protocol).FindRegion(told.symbol)) return "";
    return fmt::format("the image of {} has no variable {} (firmware/tiltproof_client.h)", ToText(spec),
                       told.symbol);
  }
  if (std::holds_alternative<HostLibrary>(spec)) {
    if (told.by_library(FirmwareFile(spec, firmware, DialectOf(*scenario.link.protocol)))) return "";
    return fmt::format("{} has no function {} (firmware/tiltproof_client.h)", ToText(spec), told.function);
  }
  // One that speaks the protocol tells it when it runs, if ever.
  if (const auto* program = std::get_if<LockstepProgram>(&spec); program != nullptr && !program->clocked)
    return "";
  return fmt::format("the client {} does not report its {}", ToText(spec), told.noun);
}

// `problems`: of the formulas that name what this client does not tell, and of an arbiter that needs it.
void FindUntold(const Scenario& scenario, std::size_t client, const ClientSpec& spec, Images& images,
                std::vector<Problem>& problems) {
  const auto find = [&](const Told& told, const std::string& column) {
    for (std::size_t i = 0; i < scenario.criteria.size(); ++i) {
      if (!HasWord(scenario.criteria[i].stl, column)) continue;
      const std::string why = WhyUntold(told, scenario, client, spec, images);
      if (why.empty()) return;
      const std::string place =
          i < scenario.criterion_places.size() ? scenario.criterion_places[i] : scenario.name;
      problems.push_back(
          {fmt::format("{}: stl: '{}': {}", place, column, why), fmt::format("stl: '{}': {}", column, why)});
    }
  };
  find(kToldState, SupervisorStateColumn(scenario, client));
  if (scenario.has_several_clients()) find(kToldRole, RoleColumn(scenario, client));
  if (scenario.arbiter.type != ArbiterType::kActiveClaims) return;
  if (const std::string why = WhyUntold(kToldRole, scenario, client, spec, images); !why.empty()) {
    const std::string text = fmt::format("arbiter: active_claims needs the role of client '{}': {}",
                                         scenario.client_id(client), why);
    const std::string& place = scenario.arbiter_place;
    problems.push_back({(place.empty() ? scenario.name : place) + ": " + text, text});
  }
}

}  // namespace

std::vector<std::string> ClientProblems(const RunClients& clients, const Scenario& scenario) {
  Images images;
  std::vector<Problem> problems;
  std::vector<ClientSpec> specs;
  for (std::size_t i = 0; i < scenario.client_count(); ++i)
    specs.push_back(clients.Of(scenario.client_id(i)));
  FindUnusedGain(scenario, specs, problems);
  FindUnusedNumbers(scenario, specs, problems);
  for (std::size_t i = 0; i < scenario.client_count(); ++i) {
    const ClientSpec& client = specs[i];
    if (AbilitiesOf(client, false).shipped) {
      FindOtherVehicle(scenario, i, problems);
      FindLargeHeading(scenario, i, problems);
    }
    FindUntold(scenario, i, client, images, problems);
  }
  std::vector<std::string> texts;
  for (Problem& problem : problems) texts.push_back(std::move(problem.text));
  return texts;
}

std::vector<NotApplicable> RemoveNotApplicable(const FlightMeans& means, bool strict, Suite& suite) {
  Images images;
  std::vector<NotApplicable> left_out;
  std::vector<std::string> refused;
  std::erase_if(suite.scenarios, [&](const SuiteScenario& entry) {
    const Scenario& scenario = entry.scenario;
    const std::vector<ClientSpec> clients = means.ClientsOf(scenario);
    std::vector<ClientAbilities> abilities;
    for (const ClientSpec& client : clients) abilities.push_back(AbilitiesOf(client, means.realtime));
    std::vector<Problem> problems = UnsupportedFaults(scenario, abilities);
    FindUnconnectedLines(scenario, clients, means.realtime, problems);
    FindUnusedGain(scenario, clients, problems);
    FindUnusedNumbers(scenario, clients, problems);
    if (!means.realtime) FindUnstatedComputing(scenario, clients, problems);
    for (std::size_t i = 0; i < clients.size(); ++i) {
      std::filesystem::path file;
      if (const auto* image = std::get_if<EmulatedImage>(&clients[i])) {
        if (!problems.empty()) continue;  // not every build has an image, and this flight is refused anyway
        FindMissingRegions(images.Read(*image, scenario.firmware_of(i), *scenario.link.protocol), scenario, i,
                           problems);
        file = BoardOf(*image, scenario.firmware_of(i), *scenario.link.protocol).image;
      }
      FindUnwatchable(scenario, clients[i], file, means.realtime, problems);
      if (abilities[i].shipped) {
        FindOtherVehicle(scenario, i, problems);
        FindLargeHeading(scenario, i, problems);
      }
      FindUntold(scenario, i, clients[i], images, problems);
    }
    if (problems.empty()) return false;
    NotApplicable other{.name = entry.scenario.name, .reason = {}, .why = problems.front().why};
    for (const Problem& problem : problems) {
      if (entry.named || strict) refused.push_back(problem.text);
      other.reason += (other.reason.empty() ? "" : "; ") + problem.text;
    }
    if (!entry.named && !strict) left_out.push_back(std::move(other));
    return true;
  });
  if (!refused.empty()) throw UsageError(fmt::format("{}", fmt::join(refused, "\n")));
  return left_out;
}

std::string ReasonAgainstInjecting(const FlightMeans& means, const Scenario& scenario,
                                   const faults::FaultSpec& fault) {
  const faults::FaultType& type = *faults::FindFaultType(fault.type);
  const std::vector<ClientSpec> clients = means.ClientsOf(scenario);
  std::vector<Problem> problems;
  const auto alone = [&] {
    Scenario copy = scenario;
    copy.faults = {fault};
    return copy;
  };
  if (type.needs == faults::Needs::kComputing) FindUnstatedComputing(alone(), clients, problems);
  if (!problems.empty()) return problems.front().why;
  for (std::size_t i = 0; i < clients.size(); ++i) {
    if (!fault.client.empty() && fault.client != scenario.client_id(i)) continue;
    if (auto why = Unsupported(fault, type, AbilitiesOf(clients[i], false))) return *std::move(why);
    const auto* image = std::get_if<EmulatedImage>(&clients[i]);
    if (image == nullptr) continue;
    if (type.IsOneOf<faults::ClockKind>())
      return "cannot begin while an image flies: its board has bytes whose times are told by its clock "
             "already; put it into the scenario";
    if (!type.IsOneOf<faults::DeviceKind>()) continue;
    FindMissingRegions(Images().Read(*image, scenario.firmware_of(i), *scenario.link.protocol), alone(), i,
                       problems);
    if (!problems.empty()) return problems.front().why;
  }
  return "";
}

std::vector<std::string> ReasonsAgainst(const FlightMeans& means, const SuiteScenario& base,
                                        std::span<const EnvelopeRow> rows) {
  const VehicleSignals& signals = base.model->signals();
  const std::size_t place = *FindPlaceholder(base.scenario);
  std::vector<ClientAbilities> abilities;
  for (const ClientSpec& client : means.ClientsOf(base.scenario))
    abilities.push_back(AbilitiesOf(client, means.realtime));
  std::vector<std::string> reasons(rows.size());
  Suite suite;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    SuiteScenario entry = base;
    entry.scenario = WithRow(base.scenario, rows[i], signals);
    entry.scenario.name = std::to_string(i);
    entry.named = false;
    const faults::FaultSpec& fault = entry.scenario.faults[place];
    if (const auto problem = faults::ProtocolProblem(fault, entry.scenario.protocol_of(fault)))
      reasons[i] = problem->message;
    else if (const auto unsupported = UnsupportedFaults(entry.scenario, abilities); !unsupported.empty())
      reasons[i] = unsupported.front().why;
    else if (auto unsuited = faults::Unsuited(fault, *rows[i].type, signals))
      reasons[i] = *std::move(unsuited);
    else
      suite.scenarios.push_back(std::move(entry));
  }
  for (const NotApplicable& other : RemoveNotApplicable(means, false, suite))
    reasons[std::stoul(other.name)] = other.reason;
  return reasons;
}

}  // namespace tiltproof::harness
