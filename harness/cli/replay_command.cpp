#include <fmt/format.h>
#include <stdlib.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <memory>

#include "harness/cli/client_flag.h"
#include "harness/cli/replay_line.h"
#include "harness/cli/run_flights.h"
#include "harness/cli/run_folder.h"
#include "harness/cli/shared_options.h"
#include "harness/cli/suite.h"
#include "harness/cli/temporary_folder.h"
#include "harness/client/firmware_files.h"
#include "harness/emulator/lockstep_self_test.h"
#include "harness/report/build_id.h"
#include "harness/report/difference.h"
#include "harness/report/files.h"
#include "harness/report/flight_files.h"
#include "harness/report/flight_hashes.h"
#include "harness/report/machine.h"
#include "harness/terminal/lines.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {
namespace {

struct ReplayOptions {
  std::filesystem::path run;
  std::string program = "tiltproof";  // as it was called, for the commands that are printed
};

// The reason that a flight has no trace that another one could equal; empty when it has.
std::string NotComparable(const std::filesystem::path& scenario_folder, const FlightResult& then) {
  if (then.trace_hash.empty()) return "no flight then: " + then.score.reason;
  // Files of older versions have it elsewhere.
  const EndReason reason = then.end_reason ? *then.end_reason : ReadFlightRecord(scenario_folder).end_reason;
  return reason == EndReason::kInterrupted ? "interrupted then" : "";
}

void NoHash(const std::filesystem::path& scenario_folder, const std::string& why) {
  PrintLine(stdout, 0, fmt::format("{:<10} {:<34} {}", "NO HASH", scenario_folder.filename().string(), why));
}

// The number of flights of an unfinished run that came to a verdict.
std::size_t EndedCount(const OldRun& run) {
  std::ptrdiff_t count = 0;
  if (run.info.keep == Keep::kAll) {
    count = std::count_if(run.scenario_folders.begin(), run.scenario_folders.end(), HasEnded);
  } else {
    const std::vector<FlightResult> results = ReadResults(run.folder);
    count = std::count_if(results.begin(), results.end(), [](const FlightResult& result) {
      return result.score.cause != VerdictCause::kNotFlown;
    });
  }
  return static_cast<std::size_t>(count);
}

// Flights of a run that can be flown again and compared.
struct Repeatable {
  std::vector<FlightJob> jobs;
  std::vector<FlightResult> then;  // the old result of each
  std::size_t left_out_count = 0;  // flights without a trace that another one could equal
};

// Loads the flights of a run, and prints the reason of each that it leaves out. They are recorded in `recordings`.
Repeatable LoadRepeatable(const OldRun& run, const FlightMeans& means, const std::string& program,
                          const std::filesystem::path& recordings) {
  Repeatable flights;
  const auto leave_out = [&](const std::filesystem::path& scenario_folder, const std::string& why) {
    NoHash(scenario_folder, why);
    ++flights.left_out_count;
  };
  for (const auto& scenario_folder : run.scenario_folders) {
    if (!HasEnded(scenario_folder)) {
      leave_out(scenario_folder, kNotFlown);
      continue;
    }
    FlightResult then;
    try {
      CheckFlightFiles(scenario_folder);
      then = ReadVerdict(scenario_folder);
    } catch (const std::exception& error) {
      // The others can be compared all the same.
      leave_out(scenario_folder, error.what());
      continue;
    }
    if (const std::string why = NotComparable(scenario_folder, then); !why.empty()) {
      leave_out(scenario_folder, why);
      continue;
    }
    auto [scenario, model] = LoadFlown(scenario_folder);
    const std::string name = scenario_folder.filename();
    flights.jobs.push_back({.name = name,
                            .scenario = std::move(scenario),
                            .model = std::move(model),
                            .means = means,
                            .replay = ReplayLine(program, scenario_folder),
                            .recorder = RecorderIn(recordings / name, Keep::kAll)});
    flights.then.push_back(std::move(then));
  }
  return flights;
}

// Prints the reasons for which a replay may differ or be incomplete.
void PrintReservations(const OldRun& run, const std::string& build, bool unfinished) {
  if (run.info.build && run.info.build != build)
    PrintLine(
        stdout, 0,
        fmt::format("another build: {} then, {} now; the program or the firmware has changed, and flights "
                    "may differ",
                    *run.info.build, build));
  if (!unfinished) return;
  const std::size_t ended = EndedCount(run);
  PrintLine(
      stdout, 0,
      fmt::format("an unfinished run: {}{} flights came to a verdict; it was interrupted or killed, or is "
                  "still under way",
                  ended, run.info.flights.empty() ? "" : fmt::format(" of {}", run.info.flights.size())));
}

struct ReplayCounts {
  std::size_t different = 0, error = 0;
};

// Prints a line for each flight. Keeps those that differ or ended in an error.
ReplayCounts CompareReplays(const std::vector<FlightResult>& results, const std::vector<FlightResult>& old,
                            TemporaryFolder& folder) {
  ReplayCounts counts;
  for (std::size_t i = 0; i < results.size(); ++i) {
    const FlightDifference flight{
        .name = results[i].name, .a = old[i], .b = results[i], .criteria = {}, .trace = {}};
    const FlightResult &then = flight.a, &now = flight.b;
    if (now.score.verdict == Verdict::kError && then.score.verdict != Verdict::kError) {
      ++counts.error;
      PrintLine(stdout, 0,
                fmt::format("ERROR      {:<34} {}: {}", now.name, now.score.reason, folder.Keep(now.name)));
      continue;
    }
    const bool equal = flight.identical();
    counts.different += equal ? 0 : 1;
    PrintLine(
        stdout, 0,
        fmt::format("{:<10} {:<34} {}{}", equal ? "equal" : "DIFFERENT", now.name, then.trace_hash,
                    equal ? "" : fmt::format(" then, {} now: {}", now.trace_hash, folder.Keep(now.name))));
  }
  return counts;
}

// 0 when every trace hash is equal, whatever the verdicts. The flights are kept only when they differ or ended
// in an error.
int ReplayCommand(const ReplayOptions& options) {
  const OldRun run = OpenRun(options.run);
  if (run.info.mode == "realtime")
    throw UsageError(
        fmt::format("{}: flown in real time, where no two flights are equal to the bit; `run` flies it again",
                    options.run.string()));
  FlightMeans means;
  std::vector<std::string> flags = {run.info.client};
  for (const auto& [id, client] : run.info.clients) flags.push_back(fmt::format("{}={}", id, client));
  means.clients = ReadClientFlags(flags);
  const bool unfinished = run.whole && run.info.interrupted;
  PrintReservations(run, BuildOf(means.clients), unfinished);
  if (Emulates(means.clients.Named())) TestLockstep(LockstepPlugin());
  TemporaryFolder folder("replay");
  Repeatable flights = LoadRepeatable(run, means, options.program, folder.path());
  if (run.whole && run.info.keep != Keep::kAll)
    PrintLine(stdout, 0,
              fmt::format("{} of {} flights were kept (--keep {}), and are flown again",
                          run.scenario_folders.size(), run.info.flights.size(), Name(run.info.keep)));
  const FlownFlights outcome = RunFlights(std::move(flights.jobs), {.progress = true});
  if (outcome.interrupted) return kExitInterrupted;
  const ReplayCounts counts = CompareReplays(outcome.results, flights.then, folder);
  const std::string machines = MachineDifference(run.info.machine, ThisMachine(), "then", "now");
  if (counts.different > 0 && !machines.empty()) PrintLine(stdout, 0, "another machine: " + machines);
  Print(stdout, "{} of {} equal\n", outcome.results.size() - counts.different - counts.error,
        outcome.results.size());
  if (counts.error > 0) return kExitError;
  if (counts.different > 0) return kExitNotGreen;
  return unfinished || flights.left_out_count > 0 || outcome.results.empty() ? kExitUndecided : kExitGreen;
}

}  // namespace

void RegisterReplay(CLI::App& program, CommandLine& line) {
  const auto options = std::make_shared<ReplayOptions>();
  options->program = line.words.front();
  CLI::App* command = program.add_subcommand("replay", "Fly an old run again and compare the trace hashes");
  command->add_option("RUN", options->run, "A run's results folder, or one scenario's folder in it")
      ->required();
  SetAction(*command, line, [options] { return ReplayCommand(*options); });
}

}  // namespace tiltproof::harness
