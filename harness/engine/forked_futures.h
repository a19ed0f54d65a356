// Futures of one flight, in copies of the worker process that flies it. The worker flies up to a moment and forks a
// copy for each future. The copy flies the rest, scores the whole flight, reports, and ends. So a future costs only its
// rest, and the past counts for its score.
//
//   FutureForks forks{.moments = {2 * kNsPerS, 4 * kNsPerS}, .futures_count = 100, .channel = pipe_ends[1]};
//   FlightJob job{.name = "futures", .scenario = scenario, .model = model, .means = means, .replay = {}, .forks = forks};
//
// The parent of the worker reads the reports from the other end of the pipe while it polls its engine. A moment whose
// first future draws no random number has no other future: all are the same.
//
// A copy has only the thread that flies. A firmware with threads of its own, or in another process, is not forked.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "harness/run/flight.h"
#include "harness/run/future.h"
#include "harness/scenario/scenario.h"
#include "harness/score/score.h"

namespace tiltproof::harness {

// One message on the pipe, written at once.
struct FutureReport {
  std::uint32_t moment = 0, number = 0;  // the number of the future at its moment
  Verdict verdict = Verdict::kError;
  bool fails = false;         // FutureForks::fails
  bool drew = false;          // after the moment, a random number
  bool lost = false;          // its process died: the firmware took it along
  bool has_threads = false;   // nothing is forked: the firmware has threads
  std::array<char, 17> hash;  // of the trace; empty: not asked for
};

struct FutureForks {
  std::vector<TimeNs> moments = {};  // ascending
  std::uint32_t futures_count = 1;   // at each moment, at most
  int jobs_count = 1;                // processes at a time
  std::function<Future(std::size_t moment, std::uint32_t number)> make = {};
  std::function<bool(const Score&)> fails = {};
  // `fails` reads only this criterion, those that every flight has, and no metrics. None: it may read all.
  std::optional<std::string> criterion = {};
  bool hashes = false;  // in the reports
  int channel = -1;     // the pipe's end for writing
};

// In the worker process.
class ForkedFutures {
 public:
  ForkedFutures(const FutureForks& forks, const Scenario& scenario, const std::atomic<bool>* interrupted);

  // Flies by `fly`, and waits until all futures have reported. Returns only in the worker itself. Throws
  // std::runtime_error when no process can be forked.
  RunLog Fly(FlightOptions options, const std::function<RunLog(const FlightOptions&)>& fly);

 private:
  struct Copy {
    int pid = -1, pidfd = -1;
    std::uint32_t moment = 0, number = 0;
  };

  std::optional<Future> Reach(std::size_t moment);
  std::optional<Future> Fork(std::size_t moment, std::uint32_t number);
  void WaitUntilAtMost(std::size_t copies_count);
  void Collect(const Copy& copy);
  void Write(const FutureReport& report) const;
  [[noreturn]] void End(const RunLog& log) const;
  [[noreturn]] void EndInError() const;
  [[noreturn]] void Hand(FutureReport report) const;

  const FutureForks& forks_;
  const Scenario& scenario_;
  const std::atomic<bool>* interrupted_;
  std::deque<Copy> copies_;
  std::vector<bool> draws_;  // by moment: none of its futures has reported that it drew nothing
  // In a copy:
  std::optional<Future> future_;
  FutureReport report_{};
  std::uint64_t drawn_before_ = 0;
};

}  // namespace tiltproof::harness
