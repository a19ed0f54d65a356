// The live page as `run --live` and `node monitor --http` serve it.
//
//   LivePage page(ListenForPage(8470, "--live"), options, means, info, folder, jobs);  // before the first worker
//   page.Finished(job, result);  ...  page.Poll();
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "harness/cli/run_options.h"
#include "harness/engine/flight_job.h"
#include "harness/live/live_process.h"
#include "harness/report/results.h"
#include "harness/report/run_view.h"
#include "harness/run/bus_place.h"

namespace tiltproof::harness {

// Throws UsageError, which names the flag.
LiveSocket ListenForPage(int port, const char* flag);

class LivePage {
 public:
  // Makes the jobs tell what they do. Prints where the page is.
  LivePage(const LiveSocket& socket, const RunOptions& options, const FlightMeans& means, const RunInfo& info,
           const std::filesystem::path& folder, std::vector<FlightJob>& jobs);

  void Place(const std::string& flight, const BusPlace& place);
  void Finished(const FlightJob& job, const FlightResult& result);
  // To be called often: what the viewers ask for happens here.
  void Poll();
  bool may_begin() const { return !waits_ || live_->wants_start(); }

 private:
  RunEntry run_;
  bool waits_;
  std::map<std::string, std::size_t> numbers_;  // of flights, by name
  std::unique_ptr<LiveProcess> live_;
};

// Serves the page of a monitor. Prints its address. Throws UsageError.
std::unique_ptr<LiveProcess> ServeMonitor(int port, const dds::BusConfig& bus, const FindWatchTarget& target);

}  // namespace tiltproof::harness
