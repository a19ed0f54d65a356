#include "harness/cli/envelope_flights.h"

#include <fmt/format.h>

#include <map>
#include <utility>

#include "harness/cli/replay_line.h"
#include "harness/cli/report_command.h"
#include "harness/cli/run_flights.h"
#include "harness/cli/run_record.h"
#include "harness/report/files.h"
#include "harness/report/flight_files.h"
#include "harness/terminal/lines.h"

namespace tiltproof::harness {
KeptFlights KeepFlights(const std::filesystem::path& folder, const std::vector<SideFlight>& sides,
                        const EnvelopeOptions& options) {
  // A run for each client and type: pages of a size that opens quickly.
  std::map<std::filesystem::path, std::vector<FlightJob>> runs;
  std::map<std::filesystem::path, RunInfo> infos;
  std::map<std::string, std::filesystem::path> run_of;
  for (const SideFlight& flight : sides) {
    const std::filesystem::path run = folder / flight.side.run_folder(), own = run / flight.job.name;
    infos.try_emplace(run, LockstepRunInfo(flight.side.type, flight.job, options.command));
    FlightJob& job = runs[run].emplace_back(flight.job);
    job.recorder = RecorderIn(own, Keep::kAll);
    job.replay = ReplayLine(options.command.front(), own);
    run_of[job.name] = run;
  }
  std::map<std::filesystem::path, RunRecord> records;
  std::vector<FlightJob> jobs;
  for (const auto& [run, its] : runs) {
    // Flights of an earlier envelope in this folder.
    std::filesystem::remove_all(run);
    std::filesystem::create_directories(run);
    records.try_emplace(run, run, infos.at(run), its);
    jobs.insert(jobs.end(), its.begin(), its.end());
  }
  KeptFlights kept;
  const FlownFlights flown = RunFlights(
      std::move(jobs),
      {.jobs_count = options.jobs_count,
       .progress = !options.no_progress,
       .on_finished = [&](const FlightJob& job, const FlightResult& result) {
         records.at(run_of.at(job.name)).Add(job, result);
         ++kept.count;
         const Verdict verdict = result.score.verdict;
         // A fault that is too mild to act is survived, too: nothing is wrong.
         if (result.green() || (verdict == Verdict::kInconclusive && result.expected == Verdict::kPass))
           return;
         kept.exit = kExitError;
         PrintLine(stderr, 0,
                   fmt::format("tiltproof: envelope: the flight {} is {}, and was {} in the search: {}",
                               job.name, Name(verdict), Name(result.expected), result.score.reason));
       }});
  if (flown.interrupted) kept.exit = kExitInterrupted;
  for (auto& [run, record] : records) {
    record.Finish(flown.interrupted, "not flown: the envelope was interrupted");
    if (!options.no_report) WriteReport(run);
  }
  return kept;
}

}  // namespace tiltproof::harness
