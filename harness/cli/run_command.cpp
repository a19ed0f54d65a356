#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "harness/cli/applicability.h"
#include "harness/cli/client_flag.h"
#include "harness/cli/console.h"
#include "harness/cli/interrupt_scope.h"
#include "harness/cli/live_page.h"
#include "harness/cli/replay_line.h"
#include "harness/cli/report_command.h"
#include "harness/cli/run_flights.h"
#include "harness/cli/run_options.h"
#include "harness/cli/run_plan.h"
#include "harness/cli/run_record.h"
#include "harness/cli/shared_options.h"
#include "harness/cli/suite.h"
#include "harness/cli/sweep_table.h"
#include "harness/client/debugger.h"
#include "harness/client/firmware_files.h"
#include "harness/emulator/lockstep_self_test.h"
#include "harness/live/live_server.h"
#include "harness/process/realtime_rights.h"
#include "harness/report/build_id.h"
#include "harness/report/files.h"
#include "harness/report/flight_files.h"
#include "harness/report/json_text.h"
#include "harness/report/results.h"
#include "harness/scenario/selection.h"
#include "harness/terminal/lines.h"
#include "harness/terminal/terminal.h"
#include "link/named.h"

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
      throw UsageError(fmt::format(
          "--client {}: it knows no virtual time and cannot fly in lockstep; add --mode realtime{}",
          ToText(client),
          std::holds_alternative<Program>(client)
              ? ", or let a virtual clock hold the same program: --client 'clocked:CMD'"
              : ""));
  for (const ClientSpec& client : means.clients.Named())
    if (means.realtime && !AbilitiesOf(client, true).wall_time)
      throw UsageError(fmt::format(
          "--client {}: it flies in lockstep only, because its time is the harness's; drop --mode "
          "realtime, or fly a program with serial ports, process:CMD",
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
    for (const ClientSpec& client : means.clients.Named())
      if (const auto* program = std::get_if<LockstepProgram>(&client))
        throw UsageError(
            program->clocked
                ? std::string(
                      "--gdb: the program is a process of its own; attach to it: gdb -p PID. The time in "
                      "which it is stopped does not count")
                : fmt::format("--gdb: the program is a process of its own; start it in the debugger instead: "
                              "--client {}",
                              Quoted("program:gdbserver :1234 " + program->command)));
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

// The command that flies a flight again that cannot be replayed from its folder.
std::string FlyAgain(const RunOptions& options, const FlightMeans& means, const std::filesystem::path& file,
                     std::uint64_t seed, const std::vector<KeySetting>& settings = {}) {
  std::string command = fmt::format("{} run {}", options.command.front(), file.string());
  if (means.realtime) command += " --mode realtime";
  if (means.distributed) command += " --distributed=" + options.distributed;
  if (!options.firmware.empty()) command += " --firmware " + options.firmware;
  command += means.attach ? " --attach" : ClientFlagsOf(means.clients);
  if (means.domain != 0) command += fmt::format(" --domain {}", means.domain);
  if (!means.interface.empty()) command += " --interface " + means.interface;
  if (!means.peers.empty()) command += fmt::format(" --peers {}", fmt::join(means.peers, ","));
  for (const KeySetting& setting : settings) command += " --set " + Quoted(ToText(setting));
  return command + fmt::format(" --seed {}", seed);
}

void AddWatched(Scenario& scenario, const std::vector<std::string>& variables) {
  for (const std::string& variable : variables) {
    const auto same = [&](const std::string& other) { return WatchColumn(other) == WatchColumn(variable); };
    if (std::none_of(scenario.watch.begin(), scenario.watch.end(), same)) scenario.watch.push_back(variable);
  }
}

// Prints what would be flown, one flight per line.
void List(const RunOptions& options, const std::vector<SuiteScenario>& scenarios,
          const std::vector<PlannedRun>& plan) {
  for (const PlannedRun& flight : plan) {
    if (*InterruptScope::flag()) return;
    const Scenario& scenario = scenarios[flight.scenario].scenario;
    if (options.format == "jsonl") {
      nlohmann::ordered_json line = {
          {"name", flight.name}, {"scenario", scenario.name}, {"seed", flight.seed}};
      line["firmware"] = scenario.firmware;
      line["expected"] = Name(scenario.expected());
      line["duration_s"] = ToSeconds(scenario.duration_ns);
      Print(stdout, "{}\n", JsonLine(line));
    } else {
      Print(stdout, "{}\n", flight.name);
    }
  }
}

// --last-failed: keeps the scenarios of these flights, and says what it leaves out.
void KeepNotGreen(const std::vector<NotGreen>& last, std::vector<SuiteScenario>& scenarios) {
  const auto is_of = [](const NotGreen& flight) {
    return [&flight](const SuiteScenario& entry) { return flight.Flew(entry.scenario); };
  };
  for (const NotGreen& flight : last)
    if (std::none_of(scenarios.begin(), scenarios.end(), is_of(flight)))
      PrintLine(stderr, 0,
                fmt::format("warning: --last-failed: {} was not green either, and is not among the selected "
                            "scenarios",
                            flight.name));
  std::erase_if(scenarios, [&](const SuiteScenario& entry) {
    return std::none_of(last.begin(), last.end(),
                        [&](const NotGreen& flight) { return flight.Flew(entry.scenario); });
  });
}

// Repeats among the flights that were flown.
std::vector<Repeats> RepeatsIn(const std::vector<FlightResult>& results,
                               const std::vector<SuiteScenario>& scenarios,
                               const std::vector<PlannedRun>& plan) {
  std::map<std::string, std::string> scenario_of;
  for (const PlannedRun& flight : plan) scenario_of[flight.name] = scenarios[flight.scenario].scenario.name;
  std::vector<std::string> names;
  for (const FlightResult& result : results) names.push_back(scenario_of.at(result.name));
  return RepeatsOf(results, names);
}

int InterruptedEarly() {
  Print(stderr, "tiltproof: interrupted before the first flight; nothing was written\n");
  return kExitInterrupted;
}

// Without what depends on the folder of the run. Of a million flights this takes a while: an interrupt ends it.
std::vector<FlightJob> JobsOf(const Suite& suite, const std::vector<PlannedRun>& plan,
                              const FlightMeans& means) {
  std::vector<FlightJob> jobs;
  for (const PlannedRun& flight : plan) {
    if (*InterruptScope::flag()) break;
    const SuiteScenario& entry = suite.scenarios[flight.scenario];
    FlightJob& job = jobs.emplace_back(FlightJob{
        .name = flight.name, .scenario = entry.scenario, .model = entry.model, .means = means, .replay = {}});
    job.scenario.seed = flight.seed;
  }
  return jobs;
}

// Said once: nothing else tells why the second flight waits.
void TellWhoResets(const std::vector<ClientSpec>& clients, std::size_t flights_count) {
  for (const ClientSpec& client : clients) {
    const auto* board = std::get_if<SerialBoard>(&client);
    if (board == nullptr || !board->reset.empty() || flights_count < 2) continue;
    PrintLine(stderr, 0,
              fmt::format("tiltproof: nothing resets the board of --client {} between flights: at the begin "
                          "of each of the {} flights, reset it by hand; or add ,reset=dtr, ,reset=rts or "
                          ",reset=COMMAND to the client (docs/board.md)",
                          ToText(client), flights_count));
  }
}

// The flights of a run, and how they are flown.
struct SelectedFlights {
  FlightMeans means;
  Suite suite;
  std::vector<NotApplicable> not_applicable;
  std::vector<PlannedRun> plan;
};

// Selects what the options ask for, and plans it. Returns an exit code when nothing is left to fly.
std::optional<int> SelectFlights(const RunOptions& options, SelectedFlights& flights) {
  Suite& suite = flights.suite;
  flights.means = ChooseMeans(options);
  suite = LoadSuite(options.paths, flights.means.clients, options.firmware);
  const std::size_t found = suite.scenarios.size();
  suite.scenarios = Select(std::move(suite.scenarios), options);
  const std::vector<SweepAxis> sweep = ReadSweep(options.settings);
  if (!options.firmware.empty() &&
      std::ranges::any_of(sweep, [](const SweepAxis& axis) { return axis.path == "firmware"; }))
    throw UsageError(
        fmt::format("--set firmware: --firmware {} sets the build of every flight: leave out one of the two",
                    options.firmware));
  Sweep(sweep, flights.means.clients, options.firmware, suite);
  std::optional<std::vector<NotGreen>> last;
  if (options.last_failed) {
    last = NotGreenOfLastRun(options.out);
    if (last->empty()) {
      Print(stderr, "tiltproof: every flight of the last run was green: nothing to fly again ({})\n",
            (options.out / "latest").string());
      return kExitGreen;
    }
    if (!suite.scenarios.empty()) KeepNotGreen(*last, suite.scenarios);
  }
  for (auto& entry : suite.scenarios) AddWatched(entry.scenario, options.watch);
  for (const auto& warning : suite.warnings) Print(stderr, "warning: {}\n", warning);
  if (suite.scenarios.empty()) {
    Print(stderr, "tiltproof: nothing selected: {} scenario{} found, none matches\n", found,
          found == 1 ? "" : "s");
    return kExitUndecided;
  }
  for (const ClientSpec& client : flights.means.clients.Named()) CheckFirmwareFile(client);
  flights.not_applicable = RemoveNotApplicable(flights.means, options.strict, suite);
  flights.plan = PlanRun(options, suite.scenarios, last ? &*last : nullptr);
  if (!options.dry_run && !suite.scenarios.empty()) return std::nullopt;
  List(options, suite.scenarios, flights.plan);
  for (const NotApplicable& other : flights.not_applicable)
    Print(stderr, "not applicable: {}: {}\n", other.name, other.reason);
  if (suite.scenarios.empty()) Print(stderr, "tiltproof: nothing is left to fly with this client\n");
  if (*InterruptScope::flag()) return InterruptedEarly();
  return suite.scenarios.empty() ? kExitUndecided : kExitGreen;
}

// Checks what the flights need of this machine. Throws UsageError, or std::runtime_error.
void CheckMeans(const SelectedFlights& flights) {
  const FlightMeans& means = flights.means;
  const Scenario& first = flights.suite.scenarios.front().scenario;
  const std::vector<ClientSpec> clients = means.clients.Named();
  if (means.debug && (flights.plan.size() > 1 || first.has_several_clients()))
    throw UsageError(fmt::format(
        "--gdb debugs one flight of one client, and {} would be flown: choose one by -k",
        flights.plan.size() > 1 ? fmt::format("{} flights", flights.plan.size()) : "several clients"));
  if (Emulates(clients)) {
    if (means.realtime)
      CheckRelease();
    else
      TestLockstep(LockstepPlugin());
  }
  for (const ClientSpec& client : clients) CheckPorts(client, first);
}

RunInfo RunInfoOf(const RunOptions& options, const SelectedFlights& flights) {
  const FlightMeans& means = flights.means;
  RunInfo info;
  info.suite = flights.suite.name;
  info.started = UtcNow();
  info.seed = options.seed.value_or(flights.suite.scenarios.front().scenario.seed);
  info.mode = options.mode;
  info.client = means.client_text();
  for (const auto& [id, client] : means.clients.by_id) info.clients.emplace(id, ToText(client));
  info.build = BuildOf(means.clients);
  info.machine = ThisMachine();
  info.keep = Named<Keep>(options.keep);
  info.trace = Named<TraceFormat>(options.trace);
  if (means.realtime && !means.attach) info.realtime_rights = ProbeRealtimeRights().Text();
  info.command = options.command;
  info.not_applicable = flights.not_applicable;
  return info;
}

// Gives each flight its folder in the run's, and the command that flies it again.
void SetFolders(const RunOptions& options, const SelectedFlights& flights, const RunInfo& info,
                const std::filesystem::path& folder, std::vector<FlightJob>& jobs) {
  const FlightMeans& means = flights.means;
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    FlightJob& job = jobs[i];
    const std::filesystem::path flight_folder = folder / job.name;
    job.recorder = RecorderIn(flight_folder, info.keep, *info.trace);
    if (info.keep != Keep::kAll) {
      job.replay = FlyAgain(options, means, std::filesystem::absolute(job.scenario.file), job.scenario.seed,
                            flights.suite.scenarios[flights.plan[i].scenario].settings);
    } else if (means.realtime) {
      job.replay = FlyAgain(options, means, flight_folder / "scenario.resolved.yaml", job.scenario.seed);
    } else {
      job.replay = ReplayLine(options.command.front(), flight_folder);
    }
  }
}

// Flies them into the record, and shows them on the console and on the live page, where there is one.
FlownFlights Fly(const RunOptions& options, std::vector<FlightJob> jobs, const Console& console,
                 RunRecord& record, std::optional<LivePage>& live) {
  const bool realtime = options.mode == "realtime";
  return RunFlights(std::move(jobs), {.jobs_count = options.jobs_count,
                                      .fail_fast = options.fail_fast,
                                      .progress = !options.no_progress,
                                      .on_finished =
                                          [&](const FlightJob& job, const FlightResult& result) {
                                            record.Add(job, result);
                                            if (live) live->Finished(job, result);
                                            console.Finished(result);
                                          },
                                      .on_turn =
                                          [&] {
                                            record.Refresh();
                                            if (live) live->Poll();
                                          },
                                      .may_begin = [&] { return !live || live->may_begin(); },
                                      .on_place =
                                          [&](const std::string& flight, const BusPlace& place) {
                                            record.NotePlace(flight, place);
                                            if (live && realtime) live->Place(flight, place);
                                          }});
}

// Writes the results of --set into the run's folder, and prints them.
void ShowSweep(const SelectedFlights& flights, const std::vector<FlightResult>& results,
               const std::filesystem::path& folder, const Console& console) {
  std::map<std::string, const SuiteScenario*> cell_of;
  for (const PlannedRun& flight : flights.plan)
    cell_of[flight.name] = &flights.suite.scenarios[flight.scenario];
  std::vector<SweepRow> rows;
  for (const FlightResult& result : results) {
    const SuiteScenario& cell = *cell_of.at(result.name);
    rows.push_back({cell.scenario.name, cell.settings, result});
  }
  WriteFile(folder / "results.csv", SweepCsv(rows));
  for (const std::string& line : SweepTable(rows)) console.Line(line);
}

ModelCache ModelsOf(const Suite& suite) {
  ModelCache models;
  for (const SuiteScenario& entry : suite.scenarios) models.Add(entry.scenario, entry.model);
  return models;
}

int RunCommand(const RunOptions& options) {
  const InterruptScope scope;
  SelectedFlights flights;
  if (const std::optional<int> code = SelectFlights(options, flights)) return *code;
  CheckMeans(flights);
  std::optional<LiveSocket> page_socket;
  if (options.live_port) page_socket = ListenForPage(*options.live_port, "--live");
  const RunInfo info = RunInfoOf(options, flights);
  std::vector<FlightJob> jobs = JobsOf(flights.suite, flights.plan, flights.means);
  if (*InterruptScope::flag()) return InterruptedEarly();
  const std::filesystem::path folder = CreateRunFolder(options.out, info.suite, info.seed);
  if (LatestIsTaken(options.out))
    Print(stderr, "warning: {} is not a link and stays as it is; this run is in {}\n",
          (options.out / "latest").string(), folder.string());
  SetFolders(options, flights, info, folder, jobs);

  std::optional<LivePage> live;
  if (page_socket) live.emplace(*page_socket, options, flights.means, info, folder, jobs);
  const Console console(options.format == "jsonl");
  console.Line(fmt::format("tiltproof {}: suite {}, {} flight{}, client {}, results in {}", Version(),
                           info.suite, jobs.size(), jobs.size() == 1 ? "" : "s", info.client,
                           folder.string()));
  if (!flights.means.attach) TellWhoResets(flights.means.clients.Named(), jobs.size());
  RunRecord record(folder, info, jobs);
  const FlownFlights flown = Fly(options, std::move(jobs), console, record, live);
  record.Finish(flown.interrupted, flown.interrupted ? "not flown: the run was interrupted"
                                                     : "not flown: --fail-fast ended the run");
  std::optional<std::filesystem::path> report;
  if (!options.no_report) report = WriteReport(folder, ModelsOf(flights.suite));
  console.LeftOut(info.not_applicable);
  if (!options.settings.empty()) ShowSweep(flights, flown.results, folder, console);
  if (options.repeat_count > 1)
    console.Repeated(RepeatsIn(flown.results, flights.suite.scenarios, flights.plan));
  console.Summary(flown.results, flown.not_flown.size(), info.not_applicable.size(), flown.interrupted,
                  report);
  return flown.interrupted ? static_cast<int>(kExitInterrupted) : ExitCode(flown.results);
}

// Flights to be flown, and by what means.
void AddFlights(CLI::App& command, RunOptions& options) {
  command.add_option("PATH", options.paths, "Scenario files, or folders of them")->required();
  AddClients(command, options.clients);
  AddFirmware(command, options.firmware);
  command
      .add_option("--set", options.settings,
                  "Fly each scenario with each of these values of a key, by its path "
                  "(faults.ID.parameters.probability, initial.position_m.2); several flags make a grid")
      ->type_name("PATH=V1,V2,...")
      ->allow_extra_args(false);
  command
      .add_option("--mode", options.mode,
                  "How time passes: lockstep (virtual) or realtime (nodes, real ports)")
      ->check(CLI::IsMember({"lockstep", "realtime"}))
      ->capture_default_str();
  command
      .add_option("--distributed", options.distributed,
                  "Lockstep with plant, link and firmware in processes of their own, over dds or socket")
      ->expected(0, 1)
      ->default_str("dds")
      ->check(CLI::IsMember({"dds", "socket"}));
  command.add_flag("--attach", options.attach, "Real time with nodes that run already (tiltproof node ...)");
  AddBus(command, options.domain, options.interface, options.peers);
  command.add_option("-k", options.expression,
                     "Only scenarios whose name or tags match, for example 'delay and not reference'");
  command.add_option("--tag", options.tag, "Only scenarios with this tag");
  AddSeed(command, options.seed, "Overrides every scenario's seed");
  command
      .add_option("--repeat", options.repeat_count, "Fly each scenario N times, with seeds seed, seed+1, ...")
      ->check(CLI::Range(1, 1'000'000));
  command
      .add_option("--watch", options.watch,
                  "Also record these variables of the emulated image, as watch_NAME; repeatable")
      ->delimiter(',')
      ->allow_extra_args(false);
}

// Work on them, and their files.
void AddRecording(CLI::App& command, RunOptions& options) {
  AddJobs(command, options.jobs_count);
  command.add_option("--out", options.out, "Parent of the run's own results folder")->capture_default_str();
  command.add_flag("--fail-fast", options.fail_fast,
                   "Start no further scenario after the first that is not green");
  command.add_flag("--last-failed", options.last_failed,
                   "Only flights that were not green in the last run (`latest` in --out), with their seeds");
  command.add_flag("--dry-run", options.dry_run, "Check and list what would be flown, and stop");
  command.add_flag("--strict", options.strict,
                   "Refuse everything when a scenario of a folder cannot be flown with this client");
  AddFormat(command, options.format, "human, or jsonl: one JSON object per finished scenario");
  command
      .add_option(
          "--keep", options.keep,
          "Which flights keep their folder: all, failing (those that are not green), or verdicts (none)")
      ->check(CLI::IsMember({"all", "failing", "verdicts"}))
      ->capture_default_str();
  command
      .add_option("--trace", options.trace,
                  "The file with a flight's trace: csv (trace.csv), packed (trace.packed, a ninth of its "
                  "size), or none")
      ->check(CLI::IsMember({"csv", "packed", "none"}))
      ->capture_default_str();
}

void AddObservation(CLI::App& command, RunOptions& options) {
  AddPort(command, "--gdb", options.gdb_port, {.usual = DebugStop::kPort, .least = 1},
          "Wait for a debugger at power-on: at an emulated processor (QEMU's gdb server on this PORT of this "
          "machine), or a library");
  command.add_option("--gdb-at", options.gdb_at_s, "Wait for it at this time of the flight instead, in s")
      ->check(CLI::Range(0.0, 14400.0));
  AddPort(command, "--live", options.live_port, {.usual = kLivePort, .least = 0},
          "Serve the report's page while the run is flown, on this PORT of 127.0.0.1 (0: any that is free). "
          "With --mode realtime it can also abort, and inject faults");
  command.add_flag("--live-wait", options.live_waits, "Fly only when Start is pressed on that page");
  command.add_flag("--no-report", options.no_report, "Write no report.html");
  command.add_flag("--no-progress", options.no_progress, "No progress line on the terminal");
}

}  // namespace

void RegisterRun(CLI::App& program, CommandLine& line) {
  const auto options = std::make_shared<RunOptions>();
  options->command = line.words;
  CLI::App* command = program.add_subcommand("run", "Fly scenarios and score them");
  AddFlights(*command, *options);
  AddRecording(*command, *options);
  AddObservation(*command, *options);
  command->footer(
      "Domain, tag and run id of a flight on the bus (in real time, or --distributed=dds) are in run.json, "
      "under "
      "its `bus`, while it flies, and in its first event; docs/distributed.md shows how to listen.");
  SetAction(*command, line, [options] { return RunCommand(*options); });
}

}  // namespace tiltproof::harness
