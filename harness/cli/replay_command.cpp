#include <fmt/format.h>
#include <stdlib.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>

#include "harness/cli/client_flag.h"
#include "harness/cli/commands.h"
#include "harness/cli/run_flights.h"
#include "harness/cli/run_folder.h"
#include "harness/cli/suite.h"
#include "harness/client/firmware_files.h"
#include "harness/emulator/lockstep_self_test.h"
#include "harness/report/build_id.h"
#include "harness/report/files.h"
#include "harness/report/flight_files.h"
#include "harness/report/flight_hashes.h"
#include "harness/report/machine.h"
#include "harness/terminal/lines.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {
namespace {

// The folder of a replay's flights. Removed at the end, in every case, unless its path was printed.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::error_code error;
    const auto parent = std::filesystem::temp_directory_path(error);
    const char* tmpdir = std::getenv("TMPDIR");
    if (error)
      throw FileError(
          fmt::format("no folder for the flights of a replay: TMPDIR is '{}', which is not a folder",
                      tmpdir == nullptr ? "/tmp" : tmpdir));
    std::string name = (parent / "tiltproof-replay-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr)
      throw FileError(fmt::format("cannot create {}: {}; TMPDIR names another folder for it", name,
                                  std::strerror(errno)));
    path_ = name;
  }
  ~TemporaryFolder() {
    std::error_code error;
    if (!kept_) std::filesystem::remove_all(path_, error);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  // The folder of one flight, for a message.
  std::string Keep(const std::string& flight) {
    kept_ = true;
    return (path_ / flight).string();
  }

 private:
  std::filesystem::path path_;
  bool kept_ = false;
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

}  // namespace

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
  const std::string build = BuildOf(means.clients);
  if (run.info.build && run.info.build != build)
    PrintLine(
        stdout, 0,
        fmt::format("another build: {} then, {} now; the program or the firmware has changed, and flights "
                    "may differ",
                    *run.info.build, build));
  if (Emulates(means.clients.Named())) TestLockstep(LockstepPlugin());
  TemporaryFolder folder;
  std::vector<FlightJob> jobs;
  std::vector<FlightResult> old_results;
  std::size_t not_comparable_count = 0;
  const bool unfinished = run.whole && run.info.interrupted;
  if (unfinished) {
    const std::size_t ended = EndedCount(run);
    PrintLine(
        stdout, 0,
        fmt::format("an unfinished run: {}{} flights came to a verdict; it was interrupted or killed, or is "
                    "still under way",
                    ended, run.info.flights.empty() ? "" : fmt::format(" of {}", run.info.flights.size())));
  }
  for (const auto& scenario_folder : run.scenario_folders) {
    if (!HasEnded(scenario_folder)) {
      NoHash(scenario_folder, kNotFlown);
      ++not_comparable_count;
      continue;
    }
    try {
      CheckFlightFiles(scenario_folder);
      old_results.push_back(ResultFromJsonText(ReadFile(scenario_folder / "verdict.json")));
    } catch (const std::exception& error) {
      // The others can be compared all the same.
      NoHash(scenario_folder, error.what());
      ++not_comparable_count;
      continue;
    }
    if (const std::string why = NotComparable(scenario_folder, old_results.back()); !why.empty()) {
      NoHash(scenario_folder, why);
      old_results.pop_back();
      ++not_comparable_count;
      continue;
    }
    auto [scenario, model] = LoadFlown(scenario_folder);
    const std::string name = scenario_folder.filename();
    jobs.push_back({.name = name,
                    .scenario = std::move(scenario),
                    .model = std::move(model),
                    .means = means,
                    .replay = fmt::format("{} replay {}", options.program, scenario_folder.string()),
                    .recorder = RecorderIn(folder.path() / name, Keep::kAll)});
  }
  if (run.whole && run.info.keep != Keep::kAll)
    PrintLine(stdout, 0,
              fmt::format("{} of {} flights were kept (--keep {}), and are flown again",
                          run.scenario_folders.size(), run.info.flights.size(), Name(run.info.keep)));
  const FlownFlights outcome = RunFlights(std::move(jobs), {.progress = true});
  if (outcome.interrupted) return kExitInterrupted;
  std::size_t different_count = 0, error_count = 0;
  for (std::size_t i = 0; i < outcome.results.size(); ++i) {
    const FlightResult& now = outcome.results[i];
    const FlightResult& then = old_results[i];
    if (now.score.verdict == Verdict::kError && then.score.verdict != Verdict::kError) {
      ++error_count;
      PrintLine(stdout, 0,
                fmt::format("ERROR      {:<34} {}: {}", now.name, now.score.reason, folder.Keep(now.name)));
      continue;
    }
    const bool equal = now.trace_hash == then.trace_hash;
    different_count += equal ? 0 : 1;
    PrintLine(
        stdout, 0,
        fmt::format("{:<10} {:<34} {}{}", equal ? "equal" : "DIFFERENT", now.name, then.trace_hash,
                    equal ? "" : fmt::format(" then, {} now: {}", now.trace_hash, folder.Keep(now.name))));
  }
  const std::string machines = MachineDifference(run.info.machine, ThisMachine(), "then", "now");
  if (different_count > 0 && !machines.empty()) PrintLine(stdout, 0, "another machine: " + machines);
  Print(stdout, "{} of {} equal\n", outcome.results.size() - different_count - error_count,
        outcome.results.size());
  if (error_count > 0) return kExitError;
  if (different_count > 0) return kExitNotGreen;
  return unfinished || not_comparable_count > 0 || outcome.results.empty() ? kExitUndecided : kExitGreen;
}

}  // namespace tiltproof::harness
