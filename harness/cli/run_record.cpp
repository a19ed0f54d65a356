#include "harness/cli/run_record.h"

#include <algorithm>

#include "harness/cli/client_flag.h"
#include "harness/cli/run_folder.h"
#include "harness/report/files.h"
#include "harness/report/flight_files.h"

namespace tiltproof::harness {
namespace {

using SteadyClock = std::chrono::steady_clock;

constexpr SteadyClock::duration kRefreshEvery = std::chrono::seconds(1);
// Writing takes at most this share of the time.
constexpr int kWritingShare = 20;

}  // namespace

RunInfo LockstepRunInfo(const std::string& suite, const FlightJob& flight,
                        const std::vector<std::string>& command) {
  RunInfo info;
  info.suite = suite;
  info.started = UtcNow();
  info.seed = flight.scenario.seed;
  info.client = flight.means.client_text();
  for (const auto& [id, client] : flight.means.clients.by_id) info.clients.emplace(id, ToText(client));
  info.build = BuildOf(flight.means.clients);
  info.machine = ThisMachine();
  info.command = command;
  info.trace = TraceFormat::kCsv;
  return info;
}

RunRecord::RunRecord(std::filesystem::path folder, RunInfo info, const std::vector<FlightJob>& jobs)
    : folder_(std::move(folder)), info_(std::move(info)), due_(SteadyClock::now()) {
  info_.interrupted = true;  // as it is to stand there when this process is killed
  for (const FlightJob& job : jobs) {
    info_.flights.push_back({job.name, job.scenario.expected(), job.scenario.seed});
    open_[info_.flights.back().name] = results_.size();
    results_.push_back(NotFlown(info_.flights.back()));
  }
  WriteRunInfo(folder_, info_);
  WriteResults(folder_, info_, results_);
  WriteRunEvents(folder_, {});
}

void RunRecord::NotePlace(const std::string& flight, const BusPlace& place) {
  info_.flights[open_.at(flight)].bus = place;
  place_taken_ = true;
}

void RunRecord::Add(const FlightJob& job, const FlightResult& result) {
  KeepVerdict(folder_ / result.name, job.scenario, result, info_.keep);
  results_[open_.at(result.name)] = result;
  open_.erase(result.name);
  taken_ = true;
}

void RunRecord::Refresh() {
  const auto now = SteadyClock::now();
  if ((!taken_ && !place_taken_) || now < due_) return;
  try {
    // First: who wants to listen looks there, and a flight does not wait.
    if (place_taken_) WriteRunInfo(folder_, info_);
    place_taken_ = false;
    if (taken_) WriteResults(folder_, info_, results_);
    taken_ = false;
  } catch (const FileError&) {
  }
  const auto end = SteadyClock::now();
  due_ = end + std::max(kRefreshEvery, kWritingShare * (end - now));
}

void RunRecord::Finish(bool interrupted, const std::string& why_not) {
  info_.interrupted = interrupted;
  for (const auto& [name, place] : open_) results_[place] = NotFlown(info_.flights[place], why_not);
  WriteRunInfo(folder_, info_);
  WriteResults(folder_, info_, results_);
  WriteRunEvents(folder_, results_);
}

}  // namespace tiltproof::harness
