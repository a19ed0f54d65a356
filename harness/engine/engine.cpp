#include "harness/engine/engine.h"

#include <fmt/format.h>
#include <poll.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <utility>

#include "harness/engine/trunk.h"
#include "harness/engine/worker.h"

namespace tiltproof::harness {
namespace {

using SteadyClock = std::chrono::steady_clock;

constexpr int kTurn_ms = 100;
// Each holds a few MiB and two descriptors.
constexpr std::size_t kTrunksMax = 160;

}  // namespace

std::future<FlightResult> Engine::Submit(FlightJob job) {
  Flight& flight = waiting_.emplace_back(Flight{numbers_end_++, std::move(job), {}});
  return flight.result.get_future();
}

void Engine::Poll() {
  StartWhatFits();
  if (flying_.empty()) return;
  Wait();
  for (auto flying = flying_.begin(); flying != flying_.end();) {
    WorkerProcess& worker = *flying->worker;
    if (const auto place = worker.PollPlace()) options_.on_place(flying->flight.job.name, *place);
    if (auto result = worker.Look(flying->flight.job, options_.tell, interrupted())) {
      Flight flight = std::move(flying->flight);
      if (worker.waits() && !worker.trunk().empty())
        trunks_.push_back(std::move(flying->worker));
      else if (worker.waits() && !waiting_.empty())
        free_.push_back(std::move(flying->worker));
      flying = flying_.erase(flying);
      Finish(flight, std::move(*result));
    } else if (worker.left_flight()) {
      // No worker has it by this number: it gets a new one.
      flying->flight.number = numbers_end_++;
      waiting_.push_front(std::move(flying->flight));
      flying = flying_.erase(flying);
    } else {
      ++flying;
    }
  }
  if (flying_.empty() && waiting_.empty()) trunks_.clear();
}

void Engine::StartWhatFits() {
  while (!waiting_.empty() && !interrupted() &&
         flying_.size() < static_cast<std::size_t>(options_.jobs_count)) {
    Flying& flying = flying_.emplace_back(Flying{std::move(waiting_.front()), nullptr});
    waiting_.pop_front();
    const std::string trouble = Begin(flying);
    if (trouble.empty()) continue;
    Flight flight = std::move(flying.flight);
    flying_.pop_back();
    Finish(flight, ErrorResult(flight.job, trouble));
    break;  // the next would fare no better, and its turn may never come (--fail-fast)
  }
  // Free workers have got all flights that they can fly.
  free_.clear();
}

std::string Engine::Begin(Flying& flying) {
  FlightJob& job = flying.flight.job;
  const std::uint64_t number = flying.flight.number;
  const auto goes_on = [&](std::vector<std::unique_ptr<WorkerProcess>>& workers) {
    const auto found = std::find_if(workers.begin(), workers.end(),
                                    [&](const auto& worker) { return worker->CanGoOn(job, number); });
    if (found == workers.end()) return false;
    flying.worker = std::move(*found);
    workers.erase(found);
    flying.worker->GoOn(job, number);
    return true;
  };
  if (job.departure && goes_on(trunks_)) return {};
  if (!MayBeginTrunk(job)) job.departure.reset();
  if (!job.departure && goes_on(free_)) return {};
  flying.worker = std::make_unique<WorkerProcess>();
  return flying.worker->Start(
      job, options_.interrupted,
      {.numbers_end = numbers_end_, .find = [this](std::uint64_t wanted) { return FindWaiting(wanted); }});
}

// A flight whose trunk is under way, or has no room, is flown from the beginning.
bool Engine::MayBeginTrunk(const FlightJob& job) const {
  if (!CanDepart(job)) return false;
  std::size_t count = trunks_.size();
  for (const Flying& flying : flying_) {
    if (flying.worker == nullptr || flying.worker->trunk().empty()) continue;
    if (flying.worker->trunk() == job.departure->trunk) return false;
    ++count;
  }
  return count < kTrunksMax;
}

void Engine::DropTrunks(const std::function<bool(const std::string& name)>& drop) {
  std::erase_if(trunks_, [&](const auto& trunk) { return drop(trunk->trunk()); });
}

const FlightJob* Engine::FindWaiting(std::uint64_t number) const {
  const auto found = std::find_if(waiting_.begin(), waiting_.end(),
                                  [&](const Flight& flight) { return flight.number == number; });
  return found == waiting_.end() ? nullptr : &found->job;
}

// Until a worker ends or has something to say.
void Engine::Wait() {
  std::vector<pollfd> polled;
  for (const Flying& flying : flying_) {
    polled.push_back({flying.worker->pidfd(), POLLIN, 0});
    polled.push_back({flying.worker->result_descriptor(), POLLIN, 0});
  }
  const auto began = SteadyClock::now();
  poll(polled.data(), polled.size(), kTurn_ms);
  const TimeNs waited_ns = std::chrono::nanoseconds(SteadyClock::now() - began).count();
  if (waited_ns > WorkerProcess::kToldAfterNs) {
    for (Flying& flying : flying_) flying.worker->NoteTold();
    options_.tell(
        fmt::format("this program stood still for {:.0f} s: it was stopped, or had no processor; that time "
                    "does not count",
                    ToSeconds(waited_ns)));
  }
  if (interrupted() && !std::exchange(forwarded_, true)) {
    // Ctrl-C on a terminal reaches them anyway; a signal to this process alone does not.
    for (const Flying& flying : flying_) flying.worker->Send(SIGINT);
  }
}

void Engine::Finish(Flight& flight, FlightResult result) {
  options_.on_finished(flight.job, result);
  flight.result.set_value(std::move(result));
}

std::vector<std::string> Engine::DropWaiting() {
  std::vector<std::string> names;
  for (const Flight& flight : waiting_) names.push_back(flight.job.name);
  waiting_.clear();
  free_.clear();
  return names;
}

void Engine::DropWaiting(const std::function<bool(const FlightJob&)>& drop) {
  std::erase_if(waiting_, [&](const Flight& flight) { return drop(flight.job); });
}

std::vector<Engine::Progress> Engine::progress() const {
  std::vector<Progress> all;
  for (const Flying& flying : flying_)
    all.push_back({flying.flight.job.name, ToSeconds(flying.worker->progress_ns()),
                   ToSeconds(flying.flight.job.scenario.duration_ns)});
  return all;
}

}  // namespace tiltproof::harness
