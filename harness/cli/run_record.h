// The results of a run while it is flown: complete on the disk at any moment, with an error for every flight
// that has not ended, so that a run whose process was killed never looks green. Flights that leave no folder
// (--keep) are only in results.json: those that ended after it was last written are errors when the process
// is killed.
//
//   RunRecord record(folder, info, jobs);
//   RunFlights(jobs, {.on_finished = [&](const auto& job, const auto& result) { record.Add(job, result); }, .on_turn = [&] { record.Refresh(); }});
//   record.Finish(interrupted, "not flown: the run was interrupted");
#pragma once

#include <chrono>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "harness/engine/flight_job.h"
#include "harness/report/results.h"

namespace tiltproof::harness {

// Describes a run in lockstep of flights with the clients and the seed of this one. `command`: as typed.
RunInfo LockstepRunInfo(const std::string& suite, const FlightJob& flight,
                        const std::vector<std::string>& command);

class RunRecord {
 public:
  // Writes run.json, results.json, junit.xml and an empty events.jsonl. Throws FileError, as Finish does.
  RunRecord(std::filesystem::path folder, RunInfo info, const std::vector<FlightJob>& jobs);

  // A flight goes on the bus.
  void NotePlace(const std::string& flight, const BusPlace& place);
  // A flight has ended.
  void Add(const FlightJob& job, const FlightResult& result);
  // Writes the new results, unless results were written within the last second; less often for a run so large
  // that writing takes long. Finish reports a disk that refuses.
  void Refresh();
  // The flights that have not ended remain errors, with this reason.
  void Finish(bool interrupted, const std::string& why_not);

 private:
  std::filesystem::path folder_;
  RunInfo info_;
  std::vector<FlightResult> results_;         // one per planned flight
  std::map<std::string, std::size_t> open_;   // those that have not ended: where in results_
  bool taken_ = false, place_taken_ = false;  // since the last writing
  std::chrono::steady_clock::time_point due_;
};

}  // namespace tiltproof::harness
