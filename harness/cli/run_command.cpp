// Boost 1.74's Asio uses std::exchange without its header.
#include <utility>
//
#include <fmt/format.h>
#include <unistd.h>

#include <boost/asio/io_context.hpp>
#include <map>
#include <nlohmann/json.hpp>

#include "faults/device_command.h"
#include "faults/registry.h"
#include "harness/cli/commands.h"
#include "harness/cli/console.h"
#include "harness/cli/data_files.h"
#include "harness/cli/run_record.h"
#include "harness/cli/suite.h"
#include "harness/cli/worker_pool.h"
#include "harness/emulator/elf_symbols.h"
#include "harness/emulator/lockstep_self_test.h"
#include "harness/node/realtime_rights.h"
#include "harness/report/build_id.h"
#include "harness/report/files.h"
#include "harness/report/results.h"
#include "harness/scenario/fault_support.h"
#include "harness/scenario/selection.h"
#include "link/serial_port.h"
#include "link/unix_socket.h"

namespace tiltproof::harness {
namespace {

FlightMeans ChooseMeans(const RunOptions& options) {
  FlightMeans means;
  means.client = ChooseClient(options.client);
  means.realtime = options.mode == "realtime";
  if (!options.distributed.empty())
    means.distributed = options.distributed == "socket" ? Transport::kSocket : Transport::kDds;
  means.attach = options.attach;
  means.domain = options.domain;
  means.interface = options.interface;
  means.peers = options.peers;
  if (!means.realtime && !means.client.knows_virtual_time())
    throw UsageError(
        fmt::format("--client {}: it knows no virtual time and cannot fly in lockstep; add --mode realtime",
                    options.client));
  if (means.realtime && means.distributed)
    throw UsageError("--distributed is for lockstep: in real time every part is a process of its own anyway");
  if (!means.realtime && (means.attach || !means.interface.empty() || !means.peers.empty()))
    throw UsageError("--attach, --interface and --peers need --mode realtime");
  if (means.attach && options.client != "host")
    throw UsageError(
        "--attach: the firmware is that of the attached nodes; give --client to them, not to `run`");
  if (means.attach) means.client.text = "attached";
  if (means.attach && options.jobs_count > 1)
    throw UsageError("--attach: the nodes fly one scenario at a time; drop -j");
  return means;
}

// That the client can suffer the faults, in this mode.
void CheckFaults(const FlightMeans& means, const std::vector<SuiteScenario>& scenarios) {
  ClientAbilities abilities{ClientKind::kLibrary, means.realtime};
  if (!means.client.command.empty()) abilities.client = ClientKind::kProcess;
  if (!means.client.device.empty()) abilities.client = ClientKind::kSerial;
  if (means.client.emulator) abilities.client = ClientKind::kEmulator;
  std::vector<std::string> problems;
  for (const auto& entry : scenarios)
    for (auto& problem : UnsupportedFaults(entry.scenario, abilities)) problems.push_back(std::move(problem));
  if (!problems.empty()) throw UsageError(fmt::format("{}", fmt::join(problems, "\n")));
}

// That the image has the memory that the scenario's faults flip.
void CheckRegions(const ElfSymbols& image, const Scenario& scenario, std::vector<std::string>& problems) {
  for (std::size_t i = 0; i < scenario.faults.size(); ++i) {
    const faults::FaultSpec& fault = scenario.faults[i];
    if (fault.type != "device.bit_flip") continue;
    const faults::Parameters parameters = ResolvedParameters(fault, faults::ValidType(fault));
    try {
      const MemoryRegion region = image.Region(parameters.Text("region"));
      faults::DrawBitFlips(0, region.size_bytes, parameters.Integer("bit_count"));
    } catch (const std::exception& error) {
      problems.push_back(fmt::format("{}: {}", FaultPlace(scenario, i), error.what()));
    }
  }
}

// That there is an image for every scenario, and what its faults need is in it.
void CheckImages(const FlightMeans& means, const std::vector<SuiteScenario>& scenarios) {
  if (!means.client.emulator) return;
  std::map<std::filesystem::path, ElfSymbols> images;
  std::vector<std::string> problems;
  for (const auto& entry : scenarios) {
    const auto file = means.client.FirmwareFile(entry.scenario);
    if (!std::filesystem::is_regular_file(file))
      throw UsageError(fmt::format("--client {}: no image at {}{}", means.client.text, file.string(),
                                   !means.client.image.empty() ? ""
                                   : means.client.scheduler == "freertos"
                                       ? ": it is built where FREERTOS_KERNEL_PATH names a FreeRTOS kernel, "
                                         "or `./setup --freertos` has fetched one"
                                       : ": it is built where gcc-arm-none-eabi is installed; run ./setup"));
    try {
      CheckRegions(images.try_emplace(file, file).first->second, entry.scenario, problems);
    } catch (const std::runtime_error& error) {
      throw UsageError(fmt::format("--client {}: {}", means.client.text, error.what()));
    }
  }
  if (!problems.empty()) throw UsageError(fmt::format("{}", fmt::join(problems, "\n")));
}

// That the board's ports can be had, before anything is flown: a flag that names no device is a mistake of the
// command line, a device that is busy or not permitted is trouble with the target.
void CheckPorts(const ClientChoice& client, const LinkSpec& link) {
  boost::asio::io_context loop;
  std::vector<std::unique_ptr<link::SerialPort>> ports;  // both at once, as in flight
  for (const std::string& device : {client.device, client.reference_device}) {
    if (device.empty()) continue;
    const bool is_socket = link::IsSocketName(device);
    try {
      // An emulator may begin as soon as it is connected, so that a socket is only looked for.
      if (const auto trouble = is_socket ? link::SocketTrouble(device) : std::nullopt)
        throw std::runtime_error(*trouble);
      if (is_socket) continue;
      ports.push_back(std::make_unique<link::SerialPort>(
          loop, device, ports.empty() ? link.port_baud() : LinkSpec::kReferenceBaud));
    } catch (const std::runtime_error& error) {
      const std::string text = fmt::format("--client {}: {}", client.text, error.what());
      std::error_code ignored;
      const std::string file = is_socket ? device.substr(device.find(':') + 1) : device;
      if (!std::filesystem::exists(file, ignored)) throw UsageError(text);
      throw std::runtime_error(text);
    }
  }
}

// Throws UsageError when -k or --tag is no valid selection.
std::vector<SuiteScenario> Select(std::vector<SuiteScenario> scenarios, const RunOptions& options) {
  try {
    const Selection selection(options.expression, options.tag);
    std::erase_if(scenarios, [&](const auto& entry) { return !selection.Matches(entry.scenario); });
  } catch (const std::invalid_argument& error) {
    throw UsageError(fmt::format("-k {}: {}", options.expression, error.what()));
  }
  return scenarios;
}

// For a shell.
std::string Quoted(const std::string& text) {
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

// The command that flies a flight in real time again.
std::string FlyAgain(const RunOptions& options, const FlightMeans& means, const FlightJob& job) {
  std::string command = fmt::format("{} run {} --mode realtime", options.command.front(),
                                    (job.folder / "scenario.resolved.yaml").string());
  command += means.attach ? " --attach" : " --client " + Quoted(means.client.text);
  if (means.domain != 0) command += fmt::format(" --domain {}", means.domain);
  if (!means.interface.empty()) command += " --interface " + means.interface;
  if (!means.peers.empty()) command += fmt::format(" --peers {}", fmt::join(means.peers, ","));
  return command + fmt::format(" --seed {}", job.scenario.seed);
}

// Of one flight, unique in the run: names its folder.
std::string FlightName(const RunOptions& options, const Scenario& scenario, std::uint64_t seed) {
  return options.repeat_count == 1 ? scenario.name : fmt::format("{}-seed{}", scenario.name, seed);
}

// What would be flown, one a line.
void List(const RunOptions& options, const std::vector<SuiteScenario>& scenarios) {
  for (const auto& entry : scenarios) {
    const std::uint64_t first = options.seed.value_or(entry.scenario.seed);
    for (int repeat = 0; repeat < options.repeat_count; ++repeat) {
      const std::uint64_t seed = first + static_cast<std::uint64_t>(repeat);
      const std::string name = FlightName(options, entry.scenario, seed);
      if (options.format == "jsonl") {
        nlohmann::ordered_json line = {{"name", name}, {"scenario", entry.scenario.name}, {"seed", seed}};
        line["expected"] = Name(entry.scenario.expect);
        line["duration_s"] = ToSeconds(entry.scenario.duration_ns);
        fmt::print("{}\n", line.dump());
      } else {
        fmt::print("{}\n", name);
      }
    }
  }
}

}  // namespace

int RunCommand(const RunOptions& options) {
  const FlightMeans means = ChooseMeans(options);
  Suite suite = LoadSuite(options.paths, options.client);
  const std::size_t found = suite.scenarios.size();
  suite.scenarios = Select(std::move(suite.scenarios), options);
  const Console console(options.format == "jsonl");
  for (const auto& warning : suite.warnings) fmt::print(stderr, "warning: {}\n", warning);
  if (suite.scenarios.empty()) {
    fmt::print(stderr, "tiltproof: nothing selected: {} scenario{} found, none matches\n", found,
               found == 1 ? "" : "s");
    return kExitUndecided;
  }
  for (const auto& entry : suite.scenarios) {
    const std::uint64_t first = options.seed.value_or(entry.scenario.seed);
    if (kSeedMax - first < static_cast<std::uint64_t>(options.repeat_count) - 1)
      throw UsageError(fmt::format("--repeat {}: from seed {} on the seeds exceed {}", options.repeat_count,
                                   first, kSeedMax));
  }
  CheckFaults(means, suite.scenarios);
  CheckImages(means, suite.scenarios);
  if (options.dry_run) {
    List(options, suite.scenarios);
    return kExitGreen;
  }
  if (means.client.emulator && !means.realtime) TestLockstep(LockstepPlugin());
  CheckPorts(means.client, suite.scenarios.front().scenario.link);

  RunInfo info;
  info.suite = suite.name;
  info.started = UtcNow();
  info.seed = options.seed.value_or(suite.scenarios.front().scenario.seed);
  info.mode = options.mode;
  info.client = means.client.text;
  info.build = BuildId(means.client.BuiltFile());
  if (means.realtime && !means.attach) info.realtime_rights = ProbeRealtimeRights().Text();
  info.command = options.command;
  const std::filesystem::path folder = CreateRunFolder(options.out, suite.name, info.seed);
  if (LatestIsTaken(options.out))
    fmt::print(stderr, "warning: {} is no link and stays as it is; this run is in {}\n",
               (options.out / "latest").string(), folder.string());

  std::vector<FlightJob> jobs;
  for (const auto& [scenario, model, named] : suite.scenarios) {
    for (int repeat = 0; repeat < options.repeat_count; ++repeat) {
      FlightJob job{scenario, model, means, {}, {}};
      job.scenario.seed = options.seed.value_or(scenario.seed) + static_cast<std::uint64_t>(repeat);
      job.folder = folder / FlightName(options, scenario, job.scenario.seed);
      job.replay = means.realtime ? FlyAgain(options, means, job)
                                  : fmt::format("{} replay {}", options.command.front(), job.folder.string());
      jobs.push_back(std::move(job));
    }
  }

  console.Line(fmt::format("tiltproof {}: suite {}, {} flight{}, client {}, results in {}", Version(),
                           suite.name, jobs.size(), jobs.size() == 1 ? "" : "s", info.client,
                           folder.string()));
  RunRecord record(folder, info, jobs);
  const bool progress = !options.no_progress && isatty(STDERR_FILENO) != 0;
  const PoolOutcome outcome = FlyAll(
      jobs, {.jobs_count = options.jobs_count, .fail_fast = options.fail_fast, .progress = progress},
      [&](const ScenarioResult& result) {
        record.Take(result);
        console.Finished(result);
      },
      [&] { record.Refresh(); });
  record.Finish(outcome.interrupted, outcome.interrupted ? "not flown: the run was interrupted"
                                                         : "not flown: --fail-fast ended the run");
  console.Summary(outcome.results, outcome.not_flown, outcome.interrupted);
  return outcome.interrupted ? static_cast<int>(kExitInterrupted) : ExitCode(outcome.results);
}

}  // namespace tiltproof::harness
