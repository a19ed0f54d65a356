#include "harness/cli/run_flights.h"

#include <fmt/format.h>

#include <atomic>
#include <csignal>
#include <cstdio>
#include <future>
#include <utility>

#include "harness/terminal/terminal.h"

namespace tiltproof::harness {
namespace {

std::atomic<bool> interrupted{false};

void OnInterrupt(int) { interrupted.store(true, std::memory_order_relaxed); }

// Puts our handlers in place for as long as it lives.
class InterruptScope {
 public:
  InterruptScope() {
    interrupted = false;
    struct sigaction action {};
    action.sa_handler = OnInterrupt;
    sigemptyset(&action.sa_mask);
    sigaction(SIGINT, &action, &old_int_);
    sigaction(SIGTERM, &action, &old_term_);
    sigaction(SIGHUP, &action, &old_hangup_);
    // Inherited as ignored, it would let the kernel reap our workers before we have seen how they ended.
    action.sa_handler = SIG_DFL;
    sigaction(SIGCHLD, &action, &old_child_);
  }
  ~InterruptScope() {
    sigaction(SIGINT, &old_int_, nullptr);
    sigaction(SIGTERM, &old_term_, nullptr);
    sigaction(SIGHUP, &old_hangup_, nullptr);
    sigaction(SIGCHLD, &old_child_, nullptr);
  }
  InterruptScope(const InterruptScope&) = delete;
  InterruptScope& operator=(const InterruptScope&) = delete;

 private:
  struct sigaction old_int_ {};
  struct sigaction old_term_ {};
  struct sigaction old_hangup_ {};
  struct sigaction old_child_ {};
};

// The line that is written over and over.
class ProgressLine {
 public:
  explicit ProgressLine(bool wanted) : wanted_(wanted) {}

  void Show(const Engine& engine) {
    const auto flights = engine.progress();
    if (!wanted_ || flights.empty()) return;
    std::string line;
    for (const auto& flight : flights)
      line += fmt::format("  {} {:.0f}/{:.0f} s", flight.name, flight.flown_s, flight.duration_s);
    Print(stderr, "\r\033[K{}", line.substr(0, 110));
    std::fflush(stderr);
    shown_ = true;
  }
  void Clear() {
    if (std::exchange(shown_, false)) Print(stderr, "\r\033[K");
  }

 private:
  bool wanted_;
  bool shown_ = false;
};

}  // namespace

FlownFlights RunFlights(std::vector<FlightJob> jobs, const RunFlightsOptions& options) {
  const InterruptScope scope;
  ProgressLine line(options.progress);
  bool stop = false;
  Engine engine({.jobs_count = options.jobs_count,
                 .on_finished =
                     [&](const FlightJob& job, const FlightResult& result) {
                       line.Clear();
                       options.on_finished(job, result);
                       if (options.fail_fast && !result.green()) stop = true;
                     },
                 .on_place = options.on_place,
                 .tell =
                     [&](const std::string& text) {
                       line.Clear();
                       Print(stderr, "tiltproof: {}\n", text);
                     },
                 .interrupted = &interrupted});
  std::vector<std::future<FlightResult>> futures;
  for (FlightJob& job : jobs) futures.push_back(engine.Submit(std::move(job)));
  FlownFlights flown;
  while (!engine.idle()) {
    engine.Turn();
    if (stop && flown.not_flown.empty()) flown.not_flown = engine.DropWaiting();
    options.on_turn();
    line.Show(engine);
  }
  line.Clear();
  for (std::string& name : engine.DropWaiting()) flown.not_flown.push_back(std::move(name));
  flown.interrupted = interrupted;
  for (auto& future : futures) {
    try {
      flown.results.push_back(future.get());
    } catch (const std::future_error&) {
      // It never began.
    }
  }
  return flown;
}

}  // namespace tiltproof::harness
