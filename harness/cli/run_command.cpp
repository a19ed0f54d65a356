#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "harness/cli/applicability.h"
#include "harness/cli/client_flag.h"
#include "harness/cli/commands.h"
#include "harness/cli/console.h"
#include "harness/cli/live_page.h"
#include "harness/cli/report_command.h"
#include "harness/cli/run_flights.h"
#include "harness/cli/run_record.h"
#include "harness/cli/suite.h"
#include "harness/client/firmware_files.h"
#include "harness/emulator/lockstep_self_test.h"
#include "harness/node/realtime_rights.h"
#include "harness/report/build_id.h"
#include "harness/report/files.h"
#include "harness/report/flight_files.h"
#include "harness/report/json_text.h"
#include "harness/report/results.h"
#include "harness/scenario/selection.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {
namespace {

FlightMeans ChooseMeans(const RunOptions& options) {
  FlightMeans means;
  means.clients = ReadClientFlags(options.clients);
  means.realtime = options.mode == "realtime";
  if (!options.distributed.empty())
    means.distributed = options.distributed == "socket" ? Transport::kSocket : Transport::kDds;
  means.attach = options.attach;
  means.domain = options.domain;
  means.interface = options.interface;
  means.peers = options.peers;
  for (const ClientSpec& client : means.clients.Named())
    if (!means.realtime && !AbilitiesOf(client, false).virtual_time)
      throw UsageError(
          fmt::format("--client {}: it knows no virtual time and cannot fly in lockstep; add --mode realtime",
                      ToText(client)));
  if (means.realtime && means.distributed)
    throw UsageError("--distributed is for lockstep: in real time every part is a process of its own anyway");
  if (!means.realtime && (means.attach || !means.interface.empty() || !means.peers.empty()))
    throw UsageError("--attach, --interface and --peers need --mode realtime");
  if (means.attach && !options.clients.empty() && options.clients != std::vector<std::string>{"host"})
    throw UsageError(
        "--attach: the firmware is that of the attached nodes; give --client to them, not to `run`");
  if (means.attach && options.jobs_count > 1)
    throw UsageError("--attach: the nodes fly one scenario at a time; drop -j");
  if (options.gdb_port || options.gdb_at_s) {
    if (means.realtime || means.distributed)
      throw UsageError("--gdb: only in lockstep, in one process: there the vehicle waits for the debugger");
    means.debug.emplace();
    if (options.gdb_port) means.debug->port = *options.gdb_port;
    if (options.gdb_at_s) means.debug->at_ns = FromSeconds(*options.gdb_at_s);
  }
  if (options.live_waits && !(options.live_port && means.realtime))
    throw UsageError(
        "--live-wait: only with --live and --mode realtime, where the page has the button Start");
  if (options.live_port && means.realtime && options.jobs_count > 1)
    throw UsageError("--live: in real time its page shows and commands one flight at a time; drop -j");
  return means;
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

std::string ClientFlagsOf(const RunClients& clients) {
  std::string flags = " --client " + Quoted(ToText(clients.all));
  for (const auto& [id, client] : clients.by_id) flags += " --client " + Quoted(id + "=" + ToText(client));
  return flags;
}

// The command that flies a flight again that cannot be replayed from its folder.
std::string FlyAgain(const RunOptions& options, const FlightMeans& means, const std::filesystem::path& file,
                     std::uint64_t seed) {
  std::string command = fmt::format("{} run {}", options.command.front(), file.string());
  if (means.realtime) command += " --mode realtime";
  if (means.distributed) command += " --distributed=" + options.distributed;
  if (!options.firmware.empty()) command += " --firmware " + options.firmware;
  command += means.attach ? " --attach" : ClientFlagsOf(means.clients);
  if (means.domain != 0) command += fmt::format(" --domain {}", means.domain);
  if (!means.interface.empty()) command += " --interface " + means.interface;
  if (!means.peers.empty()) command += fmt::format(" --peers {}", fmt::join(means.peers, ","));
  return command + fmt::format(" --seed {}", seed);
}

// Of one flight, unique in the run: names its folder.
std::string FlightName(const RunOptions& options, const Scenario& scenario, std::uint64_t seed) {
  return options.repeat_count == 1 ? scenario.name : fmt::format("{}-seed{}", scenario.name, seed);
}

void AddWatched(Scenario& scenario, const std::vector<std::string>& variables) {
  for (const std::string& variable : variables) {
    const auto same = [&](const std::string& other) { return WatchColumn(other) == WatchColumn(variable); };
    if (std::none_of(scenario.watch.begin(), scenario.watch.end(), same)) scenario.watch.push_back(variable);
  }
}

// Prints what would be flown, one scenario per line.
void List(const RunOptions& options, const std::vector<SuiteScenario>& scenarios) {
  for (const auto& entry : scenarios) {
    const std::uint64_t first = options.seed.value_or(entry.scenario.seed);
    for (int repeat = 0; repeat < options.repeat_count; ++repeat) {
      const std::uint64_t seed = first + static_cast<std::uint64_t>(repeat);
      const std::string name = FlightName(options, entry.scenario, seed);
      if (options.format == "jsonl") {
        nlohmann::ordered_json line = {{"name", name}, {"scenario", entry.scenario.name}, {"seed", seed}};
        line["firmware"] = entry.scenario.firmware;
        line["expected"] = Name(entry.scenario.expected());
        line["duration_s"] = ToSeconds(entry.scenario.duration_ns);
        Print(stdout, "{}\n", JsonLine(line));
      } else {
        Print(stdout, "{}\n", name);
      }
    }
  }
}

// A report that cannot be written changes no verdict.
void WriteReport(const std::filesystem::path& folder, const Console& console) {
  const auto file = folder / "report.html";
  try {
    WriteFile(file, PageOf(ViewRuns({{folder, ""}})));
    console.Line("report: " + file.string());
  } catch (const std::exception& error) {
    Print(stderr, "warning: no report: {}\n", error.what());
  }
}

}  // namespace

int RunCommand(const RunOptions& options) {
  const FlightMeans means = ChooseMeans(options);
  Suite suite = LoadSuite(options.paths, means.clients, options.firmware);
  const std::size_t found = suite.scenarios.size();
  suite.scenarios = Select(std::move(suite.scenarios), options);
  for (auto& entry : suite.scenarios) AddWatched(entry.scenario, options.watch);
  const Console console(options.format == "jsonl");
  for (const auto& warning : suite.warnings) Print(stderr, "warning: {}\n", warning);
  if (suite.scenarios.empty()) {
    Print(stderr, "tiltproof: nothing selected: {} scenario{} found, none matches\n", found,
          found == 1 ? "" : "s");
    return kExitUndecided;
  }
  for (const auto& entry : suite.scenarios) {
    const std::uint64_t first = options.seed.value_or(entry.scenario.seed);
    if (kSeedMax - first < static_cast<std::uint64_t>(options.repeat_count) - 1)
      throw UsageError(fmt::format("--repeat {}: from seed {} on the seeds exceed {}", options.repeat_count,
                                   first, kSeedMax));
  }
  const std::vector<ClientSpec> clients = means.clients.Named();
  for (const ClientSpec& client : clients) CheckLibrary(client);
  const std::vector<NotApplicable> not_applicable = TakeNotApplicable(means, options.strict, suite);
  if (options.dry_run || suite.scenarios.empty()) {
    List(options, suite.scenarios);
    for (const auto& [name, reason] : not_applicable) Print(stderr, "not applicable: {}: {}\n", name, reason);
    if (suite.scenarios.empty()) Print(stderr, "tiltproof: nothing is left to fly with this client\n");
    return suite.scenarios.empty() ? kExitUndecided : kExitGreen;
  }
  const auto flights_count = suite.scenarios.size() * static_cast<std::size_t>(options.repeat_count);
  if (means.debug && (flights_count > 1 || suite.scenarios.front().scenario.has_several_clients()))
    throw UsageError(
        fmt::format("--gdb debugs one flight of one client, and {} would be flown: choose one by -k",
                    flights_count > 1 ? fmt::format("{} flights", flights_count) : "several clients"));
  if (Emulates(clients)) {
    if (means.realtime)
      CheckRelease();
    else
      TestLockstep(LockstepPlugin());
  }
  for (const ClientSpec& client : clients) CheckPorts(client, suite.scenarios.front().scenario.link);

  std::optional<LiveSocket> page_socket;
  if (options.live_port) page_socket = ListenForPage(*options.live_port, "--live");
  RunInfo info;
  info.suite = suite.name;
  info.started = UtcNow();
  info.seed = options.seed.value_or(suite.scenarios.front().scenario.seed);
  info.mode = options.mode;
  info.client = means.client_text();
  for (const auto& [id, client] : means.clients.by_id) info.clients.emplace(id, ToText(client));
  info.build = BuildOf(means.clients);
  info.machine = ThisMachine();
  info.keep = Named<Keep>(options.keep);
  if (means.realtime && !means.attach) info.realtime_rights = ProbeRealtimeRights().Text();
  info.command = options.command;
  info.not_applicable = not_applicable;
  const std::filesystem::path folder = CreateRunFolder(options.out, suite.name, info.seed);
  if (LatestIsTaken(options.out))
    Print(stderr, "warning: {} is no link and stays as it is; this run is in {}\n",
          (options.out / "latest").string(), folder.string());

  std::vector<FlightJob> jobs;
  for (const auto& [scenario, model, named] : suite.scenarios) {
    for (int repeat = 0; repeat < options.repeat_count; ++repeat) {
      FlightJob job{.name = {}, .scenario = scenario, .model = model, .means = means, .replay = {}};
      const std::uint64_t seed = options.seed.value_or(scenario.seed) + static_cast<std::uint64_t>(repeat);
      job.scenario.seed = seed;
      job.name = FlightName(options, scenario, seed);
      const std::filesystem::path flight_folder = folder / job.name;
      job.recorder = RecorderIn(flight_folder, info.keep);
      if (info.keep != Keep::kAll) {
        job.replay = FlyAgain(options, means, std::filesystem::absolute(scenario.file), seed);
      } else if (means.realtime) {
        job.replay = FlyAgain(options, means, flight_folder / "scenario.resolved.yaml", seed);
      } else {
        job.replay = fmt::format("{} replay {}", options.command.front(), flight_folder.string());
      }
      jobs.push_back(std::move(job));
    }
  }

  std::optional<LivePage> live;
  if (page_socket) live.emplace(*page_socket, options, means, info, folder, jobs);
  console.Line(fmt::format("tiltproof {}: suite {}, {} flight{}, client {}, results in {}", Version(),
                           suite.name, jobs.size(), jobs.size() == 1 ? "" : "s", info.client,
                           folder.string()));
  for (const auto& scenario : not_applicable) console.LeftOut(scenario);
  RunRecord record(folder, info, jobs);
  const bool progress = !options.no_progress && isatty(STDERR_FILENO) != 0;
  const FlownFlights flown =
      RunFlights(std::move(jobs), {.jobs_count = options.jobs_count,
                                   .fail_fast = options.fail_fast,
                                   .progress = progress,
                                   .on_finished =
                                       [&](const FlightJob& job, const FlightResult& result) {
                                         record.Take(job, result);
                                         if (live) live->Finished(job, result);
                                         console.Finished(result);
                                       },
                                   .on_turn =
                                       [&] {
                                         record.Refresh();
                                         if (live) live->Turn();
                                       },
                                   .may_begin = [&] { return !live || live->may_begin(); },
                                   .on_place =
                                       [&](const std::string& flight, const BusPlace& place) {
                                         record.TakePlace(flight, place);
                                         if (live && means.realtime) live->Place(flight, place);
                                       }});
  record.Finish(flown.interrupted, flown.interrupted ? "not flown: the run was interrupted"
                                                     : "not flown: --fail-fast ended the run");
  if (!options.no_report) WriteReport(folder, console);
  console.Summary(flown.results, flown.not_flown.size(), not_applicable.size(), flown.interrupted);
  return flown.interrupted ? static_cast<int>(kExitInterrupted) : ExitCode(flown.results);
}

}  // namespace tiltproof::harness
