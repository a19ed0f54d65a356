// A worker process, as its parent sees it: started with a flight, watched, and in the end a result, whatever became of it;
// then perhaps given the next flight.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "harness/client/firmware_guard.h"
#include "harness/engine/flight_job.h"
#include "harness/engine/flight_result.h"
#include "harness/process/own_time.h"
#include "harness/run/bus_place.h"
#include "link/time.h"

namespace tiltproof::harness {

struct KnownJobs;
struct WorkerReport;

class WorkerProcess {
 public:
  // When a flight has stood still for so long for a reason that is not its fault, that is said.
  static constexpr TimeNs kToldAfterNs = 5 * kNsPerS;

  WorkerProcess() = default;
  // Kills it when it still runs.
  ~WorkerProcess();
  WorkerProcess(const WorkerProcess&) = delete;
  WorkerProcess& operator=(const WorkerProcess&) = delete;

  // Empty, or why there is none.
  std::string Start(const FlightJob& job, const std::atomic<bool>* interrupted, const KnownJobs& known);
  // True if it waits for a flight, and this is one that it can be given.
  bool CanGoOn(const FlightJob& job, std::uint64_t number) const;
  void GoOn(const FlightJob& job, std::uint64_t number);
  // The name of the trunk that it flies; empty: it flies whole flights.
  const std::string& trunk() const { return trunk_; }
  // Reads what it says and watches it. The result, once the process has ended or waits for a flight; `tell` gets lines
  // for a person. `interrupted`: whether the end of the flights was asked for.
  std::optional<FlightResult> Look(const FlightJob& job, const std::function<void(const std::string&)>& tell,
                                   bool interrupted);
  bool waits() const { return waits_; }
  // It has ended, and has not begun the flight that it was given.
  bool left_flight() const { return left_flight_; }
  // Where its flight is on the bus, once, when that is known.
  std::optional<BusPlace> PollPlace();
  void Send(int signal) const;
  // Time in which nothing got on has been told of already.
  void NoteTold() { told_ = true; }

  int pidfd() const { return pidfd_; }
  // Where its result comes in; -1 when nothing comes any more.
  int result_descriptor() const { return result_ended_ ? -1 : channel_; }
  TimeNs progress_ns() const;  // simulation time

 private:
  using SteadyClock = std::chrono::steady_clock;

  void Begin(const FlightJob& job);
  void ReadResult();
  void Watch(const FlightJob& job, const std::function<void(const std::string&)>& tell);
  void GiveUp(const FlightJob& job);
  void GetsOn(const FlightJob& job, SteadyClock::time_point now);
  TimeNs Limit(const FlightJob& job, FirmwareCall inside) const;
  FlightResult Collect(const FlightJob& job, int status, const std::function<void(const std::string&)>& tell,
                       bool interrupted) const;
  FlightResult WithoutResult(const FlightJob& job, int status) const;

  pid_t pid_ = -1;
  int pidfd_ = -1;
  int channel_ = -1;                     // a socket: results come in, numbers of jobs go out
  std::uint64_t known_numbers_end_ = 0;  // of jobs that it has a copy of
  std::string trunk_;
  bool waits_ = false;
  bool left_flight_ = false;
  // State of the present flight.
  std::vector<std::uint8_t> result_bytes_;
  bool result_ended_ = false;
  WorkerReport* report_ = nullptr;
  // Last seen to get on, and how much time of its own it has had since.
  TimeNs seen_progress_ns_ = 0;
  std::uint64_t seen_calls_count_ = 0;
  SteadyClock::time_point seen_at_;
  OwnTime own_;
  bool told_ = false;
  bool place_known_ = false;
  // Since when, after an interruption, it is in a debugger or in the same call of the firmware: the number of that call.
  std::optional<SteadyClock::time_point> interrupted_at_;
  std::uint64_t interrupted_in_ = 0;
  bool given_up_ = false;  // it was killed, since it did not end after that
  FirmwareCall stopped_itself_in_ = FirmwareCall::kNone;
  // Killed for standing still; and in which of the firmware's calls, if any.
  bool stuck_ = false;
  FirmwareCall stuck_in_ = FirmwareCall::kNone;
};

}  // namespace tiltproof::harness
