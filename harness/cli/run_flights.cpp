#include "harness/cli/run_flights.h"

#include <fmt/format.h>
#include <poll.h>

#include <chrono>
#include <future>
#include <utility>

#include "harness/cli/interrupt_scope.h"
#include "harness/terminal/progress_line.h"
#include "harness/terminal/terminal.h"
#include "link/time.h"

namespace tiltproof::harness {
namespace {

using SteadyClock = std::chrono::steady_clock;
// Between two looks whether the flights may begin.
constexpr int kWait_ms = 50;

// Progress of a run. The time left is computed from the simulated seconds that are flown: scenarios differ in length.
class RunProgress {
 public:
  explicit RunProgress(const std::vector<FlightJob>& jobs) : total_(jobs.size()) {
    for (const FlightJob& job : jobs) all_s_ += ToSeconds(job.scenario.duration_ns);
  }

  void Add(const FlightJob& job, const FlightResult& result) {
    ++done_;
    not_green_ += result.green() ? 0 : 1;
    done_s_ += ToSeconds(job.scenario.duration_ns);
  }

  std::string Text(const std::vector<Engine::Progress>& flying) const {
    double flown_s = done_s_;
    for (const auto& flight : flying) flown_s += flight.flown_s;
    const double passed_s = std::chrono::duration<double>(SteadyClock::now() - begin_).count();
    std::string text = fmt::format("{} of {} flights, {} not green", done_, total_, not_green_);
    if (const auto left = TimeLeft(flown_s / all_s_, passed_s))
      text += fmt::format(", {} left", DurationText(*left));
    for (const auto& flight : flying)
      text += fmt::format("  {} {:.0f}/{:.0f} s", flight.name, flight.flown_s, flight.duration_s);
    return text;
  }

 private:
  std::size_t total_, done_ = 0, not_green_ = 0;
  double all_s_ = 0.0, done_s_ = 0.0;
  SteadyClock::time_point begin_ = SteadyClock::now();
};

}  // namespace

FlownFlights RunFlights(std::vector<FlightJob> jobs, const RunFlightsOptions& options) {
  const InterruptScope scope;
  ProgressLine line(options.progress);
  RunProgress progress(jobs);
  bool stop = false;
  Engine engine({.jobs_count = options.jobs_count,
                 .on_finished =
                     [&](const FlightJob& job, const FlightResult& result) {
                       line.Clear();
                       progress.Add(job, result);
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
      engine.Poll();
    } else {
      poll(nullptr, 0, kWait_ms);
    }
    if (stop && flown.not_flown.empty()) flown.not_flown = engine.DropWaiting();
    options.on_turn();
    line.Show(progress.Text(engine.progress()));
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
