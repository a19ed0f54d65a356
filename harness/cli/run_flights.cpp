#include "harness/cli/run_flights.h"

#include <fmt/format.h>
#include <poll.h>

#include <cstdio>
#include <future>
#include <utility>

#include "harness/cli/interrupt_scope.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {
namespace {

// Between two looks whether the flights may begin.
constexpr int kWait_ms = 50;

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
                 .interrupted = InterruptScope::flag()});
  std::vector<std::future<FlightResult>> futures;
  for (FlightJob& job : jobs) futures.push_back(engine.Submit(std::move(job)));
  FlownFlights flown;
  while (!engine.idle()) {
    if (options.may_begin()) {
      engine.Turn();
    } else {
      poll(nullptr, 0, kWait_ms);
    }
    if (stop && flown.not_flown.empty()) flown.not_flown = engine.DropWaiting();
    options.on_turn();
    line.Show(engine);
  }
  line.Clear();
  for (std::string& name : engine.DropWaiting()) flown.not_flown.push_back(std::move(name));
  flown.interrupted = *InterruptScope::flag();
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
