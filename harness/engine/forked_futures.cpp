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

namespace tiltproof::harness {
namespace {

// Exit codes of a copy.
constexpr int kDrew = 0, kDrewNothing = 3;

}  // namespace

ForkedFutures::ForkedFutures(const FutureForks& forks, const Scenario& scenario, Judge judge,
                             const std::atomic<bool>* interrupted)
    : forks_(forks),
      scenario_(scenario),
      judge_(std::move(judge)),
      interrupted_(interrupted),
      draws_(forks.moments.size(), true) {}

RunLog ForkedFutures::Fly(FlightOptions options, const std::function<RunLog(const FlightOptions&)>& fly) {
  options.moments = forks_.moments;
  options.at_moment = [this](std::size_t moment) { return Reach(moment); };
  std::optional<RunLog> log;
  try {
    log = fly(options);
    if (future_) {
      const FlightResult result = judge_(WithFuture(scenario_, *future_), *log);
      End(&result);
    }
  } catch (const std::exception&) {
    if (future_) End(nullptr);
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

// Null: the flight is an error. No destructors or exit handlers: they are the worker's.
void ForkedFutures::End(const FlightResult* result) const {
  FutureReport report = report_;
  report.drew = faults::Random::DrawnCount() != drawn_before_;
  if (result != nullptr) {
    report.verdict = result->score.verdict;
    report.fails = forks_.fails(*result);
    std::snprintf(report.hash.data(), report.hash.size(), "%s", result->trace_hash.c_str());
  }
  Write(report);
  _exit(report.drew ? kDrew : kDrewNothing);
}

}  // namespace tiltproof::harness
