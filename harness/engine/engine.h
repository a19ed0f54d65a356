// Flies scenarios in worker processes: a crash of the firmware or of ours costs one flight, and the number of jobs changes
// nothing but the wall-clock time. Workers score; results come back through memory. A flight of a user's library, in real
// time or in several processes gets a fresh worker. The shipped firmware keeps nothing between flights: one worker flies
// it many times, because the memory of a new process is slow.
//
//   Engine engine({.jobs_count = 2});
//   std::future<FlightResult> flown = engine.Submit(FlightJob{.name = "hover", .scenario = scenario, .model = model});
//   while (!engine.idle()) engine.Poll();
//   const FlightResult result = flown.get();
//
// Flights go on only in Poll() and in their own processes; there is no thread.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <future>
#include <list>
#include <memory>
#include <string>
#include <vector>

#include "harness/engine/flight_job.h"
#include "harness/engine/worker_process.h"
#include "harness/run/bus_place.h"

namespace tiltproof::harness {

class Engine {
 public:
  struct Options {
    int jobs_count = 1;
    // Called for each result as it comes, before its future is ready.
    std::function<void(const FlightJob&, const FlightResult&)> on_finished = [](const auto&, const auto&) {};
    // A flight of this name goes on the bus.
    std::function<void(const std::string& flight, const BusPlace& place)> on_place = [](const auto&,
                                                                                        const auto&) {};
    // One line for a person who waits: why a flight stands still, or how its process ended.
    std::function<void(const std::string& line)> tell = [](const auto&) {};
    // Set by a signal handler, here or in a worker: ends the flights under way, whose partial results are kept.
    // May be null.
    const std::atomic<bool>* interrupted = nullptr;
  };
  explicit Engine(Options options) : options_(std::move(options)) {}
  // Kills the workers. Futures without a result throw std::future_error.
  ~Engine() = default;
  Engine(const Engine&) = delete;
  Engine& operator=(const Engine&) = delete;

  std::future<FlightResult> Submit(FlightJob job);
  // Starts what there is room for, and waits until a flight ends, at most a tenth of a second.
  void Poll();
  // Nothing is in flight, and nothing waits that may still begin.
  bool idle() const { return flying_.empty() && (waiting_.empty() || interrupted()); }
  // Ends the trunks that wait for flights and whose names `drop` picks.
  void DropTrunks(const std::function<bool(const std::string& name)>& drop);
  // Lets what has not begun never begin: their futures throw std::future_error. Returns their names.
  std::vector<std::string> DropWaiting();
  // The same for those that `drop` picks.
  void DropWaiting(const std::function<bool(const FlightJob&)>& drop);

  // The trunks that wait for flights.
  std::size_t trunks_count() const { return trunks_.size(); }

  struct Progress {
    std::string name;
    double flown_s, duration_s;  // simulation time
  };
  // Progress of the flights under way.
  std::vector<Progress> progress() const;

 private:
  struct Flight {
    std::uint64_t number;  // in the order of submission
    FlightJob job;
    std::promise<FlightResult> result;
  };
  struct Flying {
    Flight flight;
    std::unique_ptr<WorkerProcess> worker;
  };

  bool interrupted() const {
    return options_.interrupted != nullptr && options_.interrupted->load(std::memory_order_relaxed);
  }
  void StartWhatFits();
  // Empty, or why it did not begin.
  std::string Begin(Flying& flying);
  bool MayBeginTrunk(const FlightJob& job) const;
  const FlightJob* FindWaiting(std::uint64_t number) const;
  void Wait();
  void Finish(Flight& flight, FlightResult result);

  Options options_;
  std::deque<Flight> waiting_;
  std::list<Flying> flying_;
  std::vector<std::unique_ptr<WorkerProcess>> free_;    // wait for a flight
  std::vector<std::unique_ptr<WorkerProcess>> trunks_;  // likewise
  std::uint64_t numbers_end_ = 0;
  bool forwarded_ = false;  // the interrupt, to the workers
};

}  // namespace tiltproof::harness
