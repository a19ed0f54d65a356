#include "harness/campaign/why_flights.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <future>
#include <stdexcept>
#include <utility>

#include "faults/random.h"
#include "faults/registry.h"
#include "link/check.h"

namespace tiltproof::harness {
namespace {

// The reports of forked futures.
class ReportPipe {
 public:
  ReportPipe() {
    if (pipe2(ends_.data(), O_CLOEXEC) != 0)
      throw std::runtime_error(fmt::format("cannot open a pipe to the futures: {}", std::strerror(errno)));
    fcntl(ends_[0], F_SETFL, O_NONBLOCK);
  }
  ~ReportPipe() {
    for (const int end : ends_) close(end);
  }
  ReportPipe(const ReportPipe&) = delete;
  ReportPipe& operator=(const ReportPipe&) = delete;

  int channel() const { return ends_[1]; }
  void Drain(std::vector<FutureReport>& reports) const {
    FutureReport report;
    while (read(ends_[0], &report, sizeof report) == static_cast<ssize_t>(sizeof report))
      reports.push_back(report);
  }

 private:
  std::array<int, 2> ends_{};
};

// Such faults are commands that the client has before the flight begins.
bool HasCommands(const Scenario& scenario) {
  return std::any_of(scenario.faults.begin(), scenario.faults.end(), [](const faults::FaultSpec& fault) {
    const faults::FaultType* type = faults::FindFaultType(fault.type);
    return type == nullptr || type->is_command();
  });
}

}  // namespace

WhyFlights::WhyFlights(FlightJob job, std::string criterion, Options options)
    : job_(std::move(job)),
      criterion_(std::move(criterion)),
      options_(std::move(options)),
      can_fork_(options_.may_fork && !job_.scenario.has_several_clients() && !HasCommands(job_.scenario) &&
                std::holds_alternative<HostLibrary>(job_.means.ClientsOf(job_.scenario).front())) {
  job_.recorder = {};
}

bool WhyFlights::Fails(const Score& score) const {
  if (score.cause == VerdictCause::kFirmware) return true;
  return std::any_of(score.criteria.begin(), score.criteria.end(), [&](const CriterionResult& criterion) {
    return criterion.verdict == Verdict::kFail &&
           (criterion.name == criterion_ || criterion.name == "survival");
  });
}

Future WhyFlights::FutureAt(TimeNs moment, std::size_t number) const {
  Future future{.from_ns = moment,
                .cut = {},
                .draw = faults::StreamKey(job_.scenario.seed, {"future", std::to_string(number)})};
  for (std::size_t fault = 0; fault < job_.scenario.faults.size(); ++fault) future.cut.push_back(fault);
  return future;
}

std::vector<FutureCount> WhyFlights::Futures(const std::vector<TimeNs>& moments) {
  if (can_fork_) {
    if (auto counts = Forked(moments)) return *std::move(counts);
    can_fork_ = false;
  }
  return FlownAgain(moments);
}

// None: its firmware has threads.
std::optional<std::vector<FutureCount>> WhyFlights::Forked(const std::vector<TimeNs>& moments) {
  const ReportPipe pipe;
  FlightJob job = job_;
  job.forks = FutureForks{
      .moments = moments,
      .futures_count = static_cast<std::uint32_t>(options_.futures_count),
      .jobs_count = options_.jobs_count,
      .make = [&](std::size_t moment, std::uint32_t number) { return FutureAt(moments[moment], number); },
      .fails = [this](const Score& score) { return Fails(score); },
      .criterion = criterion_,
      .channel = pipe.channel()};
  Engine engine({.jobs_count = 1, .tell = options_.tell, .interrupted = options_.interrupted});
  std::future<FlightResult> flown = engine.Submit(std::move(job));
  std::vector<FutureReport> reports;
  while (!engine.idle()) {
    engine.Poll();
    pipe.Drain(reports);
    options_.on_turn(flights_count_ + reports.size());
  }
  pipe.Drain(reports);
  if (interrupted()) return std::vector<FutureCount>();
  if (const FlightResult whole = flown.get(); whole.score.verdict == Verdict::kError)
    throw std::runtime_error(whole.score.reason);
  std::vector<FutureCount> counts(moments.size());
  // A moment without randomness has one future, even where a second had begun.
  for (const FutureReport& report : reports) {
    if (report.has_threads) return std::nullopt;
    CheckIndex(report.moment, counts.size(), "a future is of a moment that was asked for");
    if (report.verdict == Verdict::kError)
      throw std::runtime_error(fmt::format("a future from {:.3f} s on is an error of the harness",
                                           ToSeconds(moments[report.moment])));
    ++flights_count_;
    if (report.number == 0 && !report.drew) counts[report.moment] = {1, report.fails ? 1u : 0u, false};
  }
  for (const FutureReport& report : reports) {
    FutureCount& count = counts[report.moment];
    if (!count.drawn) continue;
    ++count.futures;
    count.fails += report.fails ? 1 : 0;
  }
  return counts;
}

std::vector<FutureCount> WhyFlights::FlownAgain(const std::vector<TimeNs>& moments) {
  std::vector<Future> first, others;
  for (const TimeNs moment : moments) first.push_back(FutureAt(moment, 0));
  std::vector<FutureCount> counts;
  for (const FlightResult& result : Fly(first))
    counts.push_back({1, Fails(result.score) ? std::size_t{1} : std::size_t{0}, !result.is_of_any_seed});
  if (counts.size() < moments.size()) return {};
  std::vector<std::size_t> places;
  for (std::size_t i = 0; i < moments.size(); ++i)
    for (std::size_t number = 1; counts[i].drawn && number < options_.futures_count; ++number) {
      others.push_back(FutureAt(moments[i], number));
      places.push_back(i);
    }
  const std::vector<FlightResult> results = Fly(others);
  if (results.size() < others.size()) return {};
  for (std::size_t i = 0; i < results.size(); ++i) {
    ++counts[places[i]].futures;
    counts[places[i]].fails += Fails(results[i].score) ? 1 : 0;
  }
  return counts;
}

std::vector<bool> WhyFlights::FailsWith(const std::vector<FaultSet>& sets) {
  std::vector<Future> futures;
  for (const FaultSet& kept : sets) {
    Future& future = futures.emplace_back();
    for (std::size_t fault = 0; fault < job_.scenario.faults.size(); ++fault)
      if (!kept.contains(fault)) future.cut.push_back(fault);
  }
  std::vector<bool> fails;
  for (const FlightResult& result : Fly(futures)) fails.push_back(Fails(result.score));
  return fails;
}

std::vector<FlightResult> WhyFlights::Fly(const std::vector<Future>& futures) {
  std::size_t flown_count = 0;
  Engine engine({.jobs_count = options_.jobs_count,
                 .on_finished = [&](const FlightJob&, const FlightResult&) { ++flown_count; },
                 .tell = options_.tell,
                 .interrupted = options_.interrupted});
  std::vector<std::future<FlightResult>> flown;
  for (const Future& future : futures) {
    FlightJob job = job_;
    job.name = fmt::format("{}, future {}", job_.name, flown.size());
    job.future = future;
    flown.push_back(engine.Submit(std::move(job)));
  }
  while (!engine.idle()) {
    engine.Poll();
    options_.on_turn(flights_count_ + flown_count);
  }
  flights_count_ += flown_count;
  if (interrupted()) return {};
  std::vector<FlightResult> results;
  for (std::future<FlightResult>& each : flown) {
    results.push_back(each.get());
    if (results.back().score.verdict == Verdict::kError)
      throw std::runtime_error(results.back().score.reason);
  }
  return results;
}

}  // namespace tiltproof::harness
