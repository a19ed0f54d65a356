// The flights that tiltproof why needs: futures of a flight that failed, and the flight with some of its faults only.
//
//   WhyFlights flights(job, "stays-on-path", {.jobs_count = 2, .futures_count = 100});
//   const NoReturn found = FindNoReturn(range, [&](const std::vector<TimeNs>& t) { return flights.Futures(t); });
//
// A library's futures are forked from one flight (harness/engine/forked_futures.h). An image is flown again for each
// future, with the same results.
#pragma once

#include <atomic>
#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "harness/campaign/causes.h"
#include "harness/campaign/no_return.h"
#include "harness/engine/engine.h"

namespace tiltproof::harness {

class WhyFlights {
 public:
  struct Options {
    int jobs_count = 1;
    std::size_t futures_count = 100;                 // of each moment
    bool may_fork = true;                            // false: every future is flown from the beginning
    const std::atomic<bool>* interrupted = nullptr;  // ends the flights; may be null
    std::function<void(const std::string& line)> tell = [](const auto&) {};
    // About ten times per second.
    std::function<void(std::size_t flights_count)> on_turn = [](std::size_t) {};
  };

  // `job`: the flight, which violated `criterion`.
  WhyFlights(FlightJob job, std::string criterion, Options options);

  // The futures of each moment, without faults from there on. Fewer counts: interrupted. Throws std::runtime_error
  // when a flight is an error.
  std::vector<FutureCount> Futures(const std::vector<TimeNs>& moments);
  // For each set: whether the flight fails when only these faults act. As above.
  std::vector<bool> FailsWith(const std::vector<FaultSet>& sets);

  std::size_t flights_count() const { return flights_count_; }

 private:
  bool interrupted() const {
    return options_.interrupted != nullptr && options_.interrupted->load(std::memory_order_relaxed);
  }
  // True if it violates the criterion, or does not survive.
  bool Fails(const Score& score) const;
  Future FutureAt(TimeNs moment, std::size_t number) const;
  std::optional<std::vector<FutureCount>> Forked(const std::vector<TimeNs>& moments);
  std::vector<FutureCount> FlownAgain(const std::vector<TimeNs>& moments);
  // The flights as these futures, in their order; fewer: interrupted.
  std::vector<FlightResult> Fly(const std::vector<Future>& futures);

  FlightJob job_;
  std::string criterion_;
  Options options_;
  bool can_fork_;
  std::size_t flights_count_ = 0;
};

}  // namespace tiltproof::harness
