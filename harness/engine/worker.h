// Work of a worker process: it flies a flight, scores it, lets it be recorded, and hands the result to its parent. Then
// it may be given the next.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>

#include "harness/client/firmware_guard.h"
#include "harness/engine/flight_job.h"
#include "harness/engine/flight_result.h"
#include "harness/run/bus_place.h"

namespace tiltproof::harness {

// In memory that the worker and its parent share, while the flight lasts.
struct WorkerReport {
  // Simulation time reached, and a little more while the results are made.
  std::atomic<std::int64_t> progress_ns{0};
  // A worker that has flown before takes its next flight later than that was given to it.
  std::atomic<bool> begun{true};
  // The process that flies.
  std::atomic<int> flier{0};
  FirmwareGuard::Watched firmware;

  // Ends this process if it is not the one that flies. A firmware may fork, and its copy of this process fly on. There is
  // one flight, and one result: that of the process which the engine, or its worker, has started.
  void EndOthers() const;

  // Where the flight is on the bus: set by the worker before it goes there, once.
  void SetPlace(const BusPlace& place);
  // Nullopt as long as it is not set.
  std::optional<BusPlace> Place() const;

 private:
  std::atomic<bool> has_place_{false};
  int domain_ = 0;
  std::array<char, 65> tag_{}, run_id_{};
};

// The worker's last word.
struct WorkerResult {
  bool cut_short = false;  // by a signal
  FlightResult result;
  std::string recording_trouble;  // what is missing on the disk, and why; for the worker itself
};
// Nullopt when `bytes` are not the whole of it: the worker ended before.
std::optional<WorkerResult> ReadWorkerResult(std::span<const std::uint8_t> bytes);
// True if the result is followed by the word that the worker can fly another flight.
bool AsksForNext(std::span<const std::uint8_t> bytes);

// The jobs of which a worker holds a copy, since it was forked. They hold functions: a process can be told their numbers
// only.
struct KnownJobs {
  std::uint64_t numbers_end = 0;
  // In the worker. Null: it has none of this number.
  std::function<const FlightJob*(std::uint64_t number)> find = [](std::uint64_t) { return nullptr; };
};

// Never returns. Results are written to `channel`, a socket, from which the numbers of further jobs are read, when `job`
// may share its worker. `interrupted`: set by a signal, to end the flight; may be null.
// Nothing is thrown: the parent's objects in this process must not be destroyed.
[[noreturn]] void Work(const FlightJob& job, WorkerReport& report, int channel,
                       const std::atomic<bool>* interrupted, const KnownJobs& known) noexcept;

// Writes to the parent that the worker can fly another flight. False: it cannot be reached.
bool AskForNext(int channel);

// Exit code of a worker that could not hand over its result.
inline constexpr int kExitWithoutResult = 77;

}  // namespace tiltproof::harness
