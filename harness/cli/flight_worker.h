// The worker process of one flight: flies it, scores it, writes its folder, and reports to its parent meanwhile.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <optional>
#include <string>

#include "harness/cli/worker_pool.h"
#include "harness/client/firmware_guard.h"
#include "harness/report/results.h"
#include "harness/run/bus_place.h"

namespace tiltproof::harness {

// In memory that the worker and its parent share.
struct WorkerReport {
  // Simulation time reached, and a little more while the results are made.
  std::atomic<std::int64_t> progress_ns{0};
  FirmwareGuard::Watched firmware;
  std::array<char, 1024> no_verdict_because{};  // of one that exits with kExitWithoutVerdict

  // Where the flight is on the bus: set by the worker before it goes there, once.
  void SetPlace(const BusPlace& place);
  // Nullopt as long as it is not set.
  std::optional<BusPlace> Place() const;

 private:
  std::atomic<bool> has_place_{false};
  int domain_ = 0;
  std::array<char, 65> tag_{}, run_id_{};
};

// Exit code of a worker that could not leave a verdict.
inline constexpr int kExitWithoutVerdict = 77;
// Of one whose flight was ended by a signal.
inline constexpr int kExitWorkerInterrupted = 78;

// Never returns. `interrupted`: set by a signal, to end the flight.
[[noreturn]] void Work(const FlightJob& job, WorkerReport& report, const std::atomic<bool>* interrupted);

ScenarioResult ErrorResult(const FlightJob& job, const std::string& reason);

}  // namespace tiltproof::harness
