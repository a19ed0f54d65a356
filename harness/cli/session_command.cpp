#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>
#include <CLI/CLI.hpp>

#include <cerrno>
#include <csignal>
#include <cstring>
#include <memory>
#include <stdexcept>

#include "harness/cli/applicability.h"
#include "harness/cli/client_flag.h"
#include "harness/cli/interrupt_scope.h"
#include "harness/cli/replay_line.h"
#include "harness/cli/report_command.h"
#include "harness/cli/run_flights.h"
#include "harness/cli/run_record.h"
#include "harness/cli/search_flights.h"
#include "harness/cli/session_talk.h"
#include "harness/cli/shared_options.h"
#include "harness/cli/suite.h"
#include "harness/cli/sweep.h"
#include "harness/report/files.h"
#include "harness/report/flight_files.h"
#include "harness/report/json_fields.h"
#include "harness/run/trace.h"
#include "harness/score/headline.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {
namespace {

struct SessionOptions {
  std::filesystem::path scenario;
  std::vector<std::string> clients, settings, watch;
  std::string firmware;
  std::optional<std::uint64_t> seed;
  std::filesystem::path out = "results";
  bool no_report = false;
  std::vector<std::string> command;  // as typed
};

// The standard streams of the talk. Nothing else in this process or its workers, a firmware above all, may use them.
class TalkStreams {
 public:
  TalkStreams() : in_(KeepAway(STDIN_FILENO)), out_(KeepAway(STDOUT_FILENO)) {
    const int nothing = open("/dev/null", O_RDONLY | O_CLOEXEC);
    if (nothing < 0) throw std::runtime_error(fmt::format("/dev/null: {}", std::strerror(errno)));
    dup2(nothing, STDIN_FILENO);
    close(nothing);
    dup2(STDERR_FILENO, STDOUT_FILENO);
    // A script that is gone is an answer of write().
    std::signal(SIGPIPE, SIG_IGN);
  }
  int in() const { return in_; }
  int out() const { return out_; }

 private:
  static int KeepAway(int stream) {
    constexpr int kFirst = 100;
    const int kept = fcntl(stream, F_DUPFD_CLOEXEC, kFirst);
    if (kept < 0) throw std::runtime_error(fmt::format("the standard streams: {}", std::strerror(errno)));
    return kept;
  }
  int in_, out_;
};

// The scenario, with what the flags change. Throws UsageError.
SuiteScenario Load(const SessionOptions& options, const FlightMeans& means) {
  Suite suite = LoadOneScenario(options.scenario, means.clients, "session", options.firmware);
  const std::vector<SweepAxis> settings = ReadSweep(options.settings);
  for (const SweepAxis& setting : settings)
    if (setting.values.size() != 1)
      throw UsageError(
          fmt::format("--set {}: a session flies one flight: give the key one value", setting.path));
  const std::string name = suite.scenarios.front().scenario.name;
  Sweep(settings, means.clients, options.firmware, suite);
  Scenario& scenario = suite.scenarios.front().scenario;
  scenario.name = name;
  for (const std::string& variable : options.watch)
    if (std::find(scenario.watch.begin(), scenario.watch.end(), variable) == scenario.watch.end())
      scenario.watch.push_back(variable);
  if (options.seed) scenario.seed = *options.seed;
  RemoveNotApplicable(means, true, suite);
  return std::move(suite.scenarios.front());
}

nlohmann::ordered_json EndedLine(const FlightResult& result, const std::filesystem::path& folder) {
  nlohmann::ordered_json line;
  line["ended"] = result.end_reason ? Name(*result.end_reason) : "error";
  line["folder"] = folder.string();
  const auto margin = LeastMargin(result.score);
  line["margin"] = margin ? nlohmann::ordered_json(*margin) : nlohmann::ordered_json(nullptr);
  line["result"] = nlohmann::ordered_json::parse(ToJsonText(result));
  return line;
}

int SessionCommand(const SessionOptions& options) {
  const InterruptScope scope;
  const FlightMeans means = LockstepMeans(ReadClientFlags(options.clients), "session");
  SuiteScenario entry = Load(options, means);
  CheckReady(means);
  const Scenario& scenario = entry.scenario;
  ModelCache models;  // of what is injected; a worker inherits it
  models.Add(scenario, entry.model);

  RunInfo info;
  info.suite = scenario.name;
  info.started = UtcNow();
  info.seed = scenario.seed;
  info.client = means.client_text();
  info.build = BuildOf(means.clients);
  info.machine = ThisMachine();
  info.trace = TraceFormat::kCsv;
  info.command = options.command;
  const std::filesystem::path folder =
      std::filesystem::absolute(CreateRunFolder(options.out, info.suite, info.seed));
  const std::filesystem::path flight_folder = folder / scenario.name;
  const std::string replay = ReplayLine(options.command.front(), flight_folder);

  const TalkStreams streams;
  SessionTalk talk({.in = streams.in(),
                    .out = streams.out(),
                    .hello = {{"session", 1},
                              {"version", Version()},
                              {"scenario", scenario.name},
                              {"folder", flight_folder.string()},
                              {"replay", replay},
                              {"time_s", 0.0},
                              {"duration_s", ToSeconds(scenario.end_ns())},
                              {"period_s", ToSeconds(scenario.link.protocol->control_period_ns)}},
                    .why_not =
                        [&means](const Scenario& of, const faults::FaultSpec& fault) {
                          return ReasonAgainstInjecting(means, of, fault);
                        },
                    .interrupted = InterruptScope::flag()},
                   models, Trace(TraceLayout(entry.model->signals(), scenario).columns).columns());
  std::vector<FlightJob> jobs;
  jobs.push_back({.name = scenario.name,
                  .scenario = scenario,
                  .model = entry.model,
                  .means = means,
                  .replay = replay,
                  .recorder = RecorderIn(flight_folder, Keep::kAll)});
  jobs.front().steer = [&talk](SteeredFlight& flight, Scenario& flown, const auto& alive) {
    talk.Attend(flight, flown, alive);
  };
  RunRecord record(folder, info, jobs);
  const FlownFlights flown = RunFlights(
      std::move(jobs),
      {.on_finished = [&](const FlightJob& job, const FlightResult& result) { record.Add(job, result); }});
  record.Finish(flown.interrupted, "not flown: the session was interrupted");
  if (!options.no_report) WriteReport(folder, std::move(models));
  if (!flown.results.empty()) talk.TellEnd(EndedLine(flown.results.front(), flight_folder));
  return flown.interrupted ? static_cast<int>(kExitInterrupted) : ExitCode(flown.results);
}

}  // namespace

void RegisterSession(CLI::App& program, CommandLine& line) {
  const auto options = std::make_shared<SessionOptions>();
  options->command = line.words;
  CLI::App* command = program.add_subcommand(
      "session", "Fly a scenario that a script steers, by JSON lines on the standard streams");
  command->add_option("SCENARIO", options->scenario, "A scenario file")->required();
  AddClients(*command, options->clients);
  AddFirmware(*command, options->firmware);
  command->add_option("--set", options->settings, "Another value for a key of the scenario, by its path")
      ->type_name("PATH=VALUE")
      ->allow_extra_args(false);
  AddSeed(*command, options->seed, "Overrides the scenario's seed");
  command
      ->add_option("--watch", options->watch,
                   "Also record these variables of the emulated image, as watch_NAME; repeatable")
      ->delimiter(',')
      ->allow_extra_args(false);
  command->add_option("--out", options->out, "Parent of the run's own results folder")->capture_default_str();
  command->add_flag("--no-report", options->no_report, "Write no report.html");
  command->footer("docs/session.md describes the lines; the Python module tiltproof speaks them.");
  SetAction(*command, line, [options] { return SessionCommand(*options); });
}

}  // namespace tiltproof::harness
