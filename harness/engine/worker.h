// What a worker process does: it flies one flight, scores it, lets it be recorded, and hands the result to its parent.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
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
  FirmwareGuard::Watched firmware;

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

// Never returns. The result is written to `result_descriptor`. `interrupted`: set by a signal, to end the flight; may be
// null.
// Nothing is thrown: the parent's objects in this process must not be destroyed.
[[noreturn]] void Work(const FlightJob& job, WorkerReport& report, int result_descriptor,
                       const std::atomic<bool>* interrupted) noexcept;

// Exit code of a worker that could not hand over its result.
inline constexpr int kExitWithoutResult = 77;

}  // namespace tiltproof::harness
