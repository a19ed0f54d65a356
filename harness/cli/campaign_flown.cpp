#include "harness/cli/campaign_flown.h"

#include <fmt/format.h>

#include <map>
#include <utility>

#include "harness/cli/replay_line.h"
#include "harness/cli/report_command.h"
#include "harness/cli/run_flights.h"
#include "harness/cli/run_record.h"
#include "harness/report/files.h"
#include "harness/report/flight_files.h"

namespace tiltproof::harness {
std::string RunName(std::uint64_t number) { return fmt::format("run-{}", number); }

KeptRuns KeepRuns(std::vector<FlightToKeep> flights, const CampaignOptions& options) {
  std::map<std::string, RunRecord> records;  // by the name of the flight
  std::map<std::string, std::filesystem::path> folders;
  std::vector<FlightJob> jobs;
  for (FlightToKeep& flight : flights) {
    const std::filesystem::path own = flight.folder / flight.job.name;
    std::filesystem::remove_all(own);
    std::filesystem::create_directories(flight.folder);
    if (!std::filesystem::exists(flight.folder / "scenario.yaml"))
      WriteFile(flight.folder / "scenario.yaml", WriteResolved(flight.job.scenario));
    flight.job.recorder = RecorderIn(own, Keep::kAll);
    flight.job.replay = ReplayLine(options.command.front(), own);
    records.try_emplace(flight.job.name, flight.folder,
                        LockstepRunInfo(flight.job.scenario.name, flight.job, options.command),
                        std::vector{flight.job});
    folders[flight.job.name] = flight.folder;
    jobs.push_back(std::move(flight.job));
  }
  FlownFlights flown =
      RunFlights(std::move(jobs), {.jobs_count = options.jobs_count,
                                   .progress = !options.no_progress,
                                   .on_finished = [&](const FlightJob& job, const FlightResult& result) {
                                     records.at(job.name).Add(job, result);
                                   }});
  for (auto& [name, record] : records) {
    record.Finish(flown.interrupted, "not flown: the campaign was interrupted");
    if (!options.no_report) WriteReport(folders.at(name));
  }
  return {std::move(flown.results), flown.interrupted};
}

}  // namespace tiltproof::harness
