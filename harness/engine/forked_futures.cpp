#include "harness/engine/forked_futures.h"

#include <fmt/format.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <stdexcept>
#include <utility>

#include "faults/random.h"
#include "harness/client/firmware_guard.h"
#include "harness/engine/process_state.h"
#include "harness/run/supervisor_states.h"

namespace tiltproof::harness {
namespace {

// Exit codes of a copy.
constexpr int kDrew = 0, kDrewNothing = 3;

// The parts that the judge of this criterion reads. `survival` and `control_period` need neither bytes nor states.
LogParts PartsFor(const std::string& criterion, const Scenario& scenario) {
  if (criterion == kCleanLineCriterion) return {};
  const auto spec = std::ranges::find(scenario.criteria, criterion, &CriterionSpec::name);
  if (spec == scenario.criteria.end()) return {.bytes = false, .states = false};
  if (!spec->metric.empty()) return {};
  return {.bytes = false, .states = spec->stl.find(SupervisorStateColumn(scenario, 0)) != std::string::npos};
}

}  // namespace

ForkedFutures::ForkedFutures(const FutureForks& forks, const Scenario& scenario,
                             const std::atomic<bool>* interrupted)
    : forks_(forks), scenario_(scenario), interrupted_(interrupted), draws_(forks.moments.size(), true) {}

RunLog ForkedFutures::Fly(FlightOptions options, const std::function<RunLog(const FlightOptions&)>& fly) {
  options.moments = forks_.moments;
  options.at_moment = [this](std::size_t moment) { return Reach(moment); };
  if (forks_.criterion && !forks_.hashes) options.parts = PartsFor(*forks_.criterion, scenario_);
  std::optional<RunLog> log;
  try {
    log = fly(options);
    if (future_) End(*log);
  } catch (const std::exception&) {
    if (future_) EndInError();
    throw;
  }
  WaitUntilAtMost(0);
  return *std::move(log);
}

std::optional<Future> ForkedFutures::Reach(std::size_t moment) {
  if (ThreadCount() > 1) {
    Write({.has_threads = true, .hash = {}});
    return std::nullopt;
  }
  for (std::uint32_t number = 0; number < forks_.futures_count; ++number) {
    WaitUntilAtMost(static_cast<std::size_t>(std::max(forks_.jobs_count, 1)) - 1);
    const bool interrupted = interrupted_ != nullptr && interrupted_->load(std::memory_order_relaxed);
    if (interrupted || !draws_[moment]) break;
    if (auto future = Fork(moment, number)) return future;
  }
  return std::nullopt;
}

// Returns the future in the copy.
std::optional<Future> ForkedFutures::Fork(std::size_t moment, std::uint32_t number) {
  const pid_t worker = getpid();
  const pid_t pid = fork();
  if (pid < 0) throw std::runtime_error(fmt::format("cannot fork a future: {}", std::strerror(errno)));
  const auto place = static_cast<std::uint32_t>(moment);
  if (pid > 0) {
    copies_.push_back({pid, static_cast<int>(syscall(SYS_pidfd_open, pid, 0)), place, number});
    return std::nullopt;
  }
  // A copy never outlives its worker.
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != worker) _exit(kDrew);
  FirmwareGuard::Install();
  copies_.clear();
  report_ = {.moment = place, .number = number, .hash = {}};
  drawn_before_ = faults::Random::DrawnCount();
  future_ = forks_.make(moment, number);
  return future_;
}

void ForkedFutures::WaitUntilAtMost(std::size_t copies_count) {
  while (copies_.size() > copies_count) {
    std::vector<pollfd> ends;
    for (const Copy& copy : copies_) ends.push_back({copy.pidfd, POLLIN, 0});
    if (poll(ends.data(), ends.size(), -1) <= 0) continue;
    for (std::size_t i = ends.size(); i-- > 0;) {
      if (ends[i].revents == 0) continue;
      Collect(copies_[i]);
      copies_.erase(copies_.begin() + static_cast<std::ptrdiff_t>(i));
    }
  }
}

void ForkedFutures::Collect(const Copy& copy) {
  int status = 0;
  while (waitpid(copy.pid, &status, 0) < 0 && errno == EINTR) {
  }
  close(copy.pidfd);
  if (!WIFEXITED(status))
    Write({.moment = copy.moment,
           .number = copy.number,
           .verdict = Verdict::kFail,
           .fails = true,
           .drew = true,
           .lost = true,
           .hash = {}});
  else if (WEXITSTATUS(status) == kDrewNothing)
    draws_[copy.moment] = false;
}

void ForkedFutures::Write(const FutureReport& report) const {
  while (write(forks_.channel, &report, sizeof report) < 0 && errno == EINTR) {
  }
}

void ForkedFutures::End(const RunLog& log) const {
  const Score score = ScoreRun(WithFuture(scenario_, *future_), log, {.only = forks_.criterion});
  FutureReport report = report_;
  report.verdict = score.verdict;
  report.fails = forks_.fails(score);
  if (forks_.hashes)
    std::snprintf(report.hash.data(), report.hash.size(), "%s", TraceHash(log.trace).c_str());
  Hand(report);
}

void ForkedFutures::EndInError() const { Hand(report_); }

// No destructors or exit handlers: they are the worker's.
void ForkedFutures::Hand(FutureReport report) const {
  report.drew = faults::Random::DrawnCount() != drawn_before_;
  Write(report);
  _exit(report.drew ? kDrew : kDrewNothing);
}

}  // namespace tiltproof::harness
