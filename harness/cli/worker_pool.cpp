#include "harness/cli/worker_pool.h"

#include <fmt/format.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <functional>
#include <optional>
#include <utility>

#include "harness/cli/flight_worker.h"
#include "harness/process/own_time.h"
#include "harness/report/files.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {
namespace {

using SteadyClock = std::chrono::steady_clock;

// A worker whose simulation time has stood still for so much time of its own is stuck in our code: its firmware is
// guarded (FirmwareGuard).
constexpr TimeNs kStuckAfterNs = 300 * kNsPerS;
// One that has been stopped by its firmware is given so long to leave the call, once it goes on.
constexpr TimeNs kLastChanceNs = kNsPerS;
// When a flight has stood still for so long for a reason that is not its fault, that is said.
constexpr TimeNs kToldAfterNs = 5 * kNsPerS;
// A conductor in real time makes progress on every turn of its loop, so that only scoring and writing, which
// grow with the flight, can take a while.
constexpr TimeNs kRealtimeStuckAfterNs = 10 * kNsPerS;
constexpr int kRefresh_ms = 100;

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

// Of a firmware that took its flight with it.
ScenarioResult FirmwareFailed(const FlightJob& job, const std::string& reason) {
  ScenarioResult result = ErrorResult(job, reason);
  result.score.verdict = Verdict::kFail;
  return result;
}

struct Worker {
  std::size_t job = 0;
  pid_t pid = -1;
  int pidfd = -1;
  WorkerReport* report = nullptr;
  // Last seen to get on, and how much time of its own it has had since.
  std::int64_t seen_progress_ns = 0;
  std::uint64_t seen_calls_count = 0;
  SteadyClock::time_point seen_at;
  OwnTime own;
  bool told = false;
  bool place_known = false;
  FirmwareCall stopped_itself_in = FirmwareCall::kNone;
  // Killed for standing still; and in which of the firmware's calls, if any.
  bool stuck = false;
  FirmwareCall stuck_in = FirmwareCall::kNone;
};

class Pool {
 public:
  Pool(const std::vector<FlightJob>& jobs, const PoolOptions& options,
       const std::function<void(const ScenarioResult&)>& on_finished, const std::function<void()>& on_turn,
       const std::function<void(const std::string&, const BusPlace&)>& on_place)
      : jobs_(jobs),
        options_(options),
        on_finished_(on_finished),
        on_turn_(on_turn),
        on_place_(on_place),
        results_(jobs.size()) {}

  PoolOutcome Run() {
    const InterruptScope scope;
    std::size_t next = 0;
    bool stop = false;
    while (true) {
      while (!stop && !interrupted && next < jobs_.size() &&
             workers_.size() < static_cast<std::size_t>(options_.jobs_count)) {
        const std::size_t job = next++;
        if (const std::string trouble = Start(job); !trouble.empty()) {
          results_[job] = ErrorResult(jobs_[job], trouble);
          Report(job, stop);
        }
      }
      if (workers_.empty()) break;
      Wait();
      for (std::size_t i = 0; i < workers_.size();) {
        if (!Finished(workers_[i])) {
          ++i;
          continue;
        }
        const std::size_t job = workers_[i].job;
        workers_.erase(workers_.begin() + static_cast<std::ptrdiff_t>(i));
        Report(job, stop);
      }
      on_turn_();
      ShowProgress();
    }
    ClearProgress();
    PoolOutcome outcome;
    outcome.interrupted = interrupted;
    for (std::size_t i = 0; i < jobs_.size(); ++i) {
      if (results_[i]) {
        outcome.results.push_back(std::move(*results_[i]));
      } else {
        outcome.not_flown.push_back(jobs_[i].folder.filename());
      }
    }
    return outcome;
  }

 private:
  void Report(std::size_t job, bool& stop) {
    ClearProgress();
    on_finished_(*results_[job]);
    if (options_.fail_fast && !results_[job]->green()) stop = true;
  }

  // Empty, or why there is no worker.
  std::string Start(std::size_t job) {
    void* shared =
        mmap(nullptr, sizeof(WorkerReport), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (shared == MAP_FAILED)
      return fmt::format("cannot share memory with a worker: {}", std::strerror(errno));
    Worker worker;
    worker.job = job;
    worker.report = new (shared) WorkerReport();
    std::fflush(nullptr);
    const pid_t parent = getpid();
    worker.pid = fork();
    if (worker.pid < 0) {
      const int error = errno;
      munmap(shared, sizeof(WorkerReport));
      return fmt::format("cannot start a worker: {}", std::strerror(error));
    }
    if (worker.pid == 0) {
      // A worker never outlives the run, not even when the parent is killed.
      prctl(PR_SET_PDEATHSIG, SIGKILL);
      if (getppid() != parent) _exit(1);
      Work(jobs_[job], *worker.report, &interrupted);
    }
    worker.pidfd = static_cast<int>(syscall(SYS_pidfd_open, worker.pid, 0));
    GetsOn(worker, SteadyClock::now());
    workers_.push_back(worker);
    return {};
  }

  // Until a worker ends, or the time to refresh the display.
  void Wait() {
    std::vector<pollfd> polled;
    for (const auto& worker : workers_) polled.push_back({worker.pidfd, POLLIN, 0});
    const auto began = SteadyClock::now();
    poll(polled.data(), polled.size(), kRefresh_ms);
    const TimeNs waited_ns = std::chrono::nanoseconds(SteadyClock::now() - began).count();
    if (waited_ns > kToldAfterNs) {
      for (Worker& worker : workers_) worker.told = true;
      Tell(fmt::format("this program stood still for {:.0f} s: it was stopped, or had no processor",
                       ToSeconds(waited_ns)));
    }
    if (interrupted && !forwarded_) {
      // Ctrl-C on a terminal reaches them anyway; a signal to this process alone does not.
      for (const auto& worker : workers_) kill(worker.pid, SIGINT);
      forwarded_ = true;
    }
  }

  bool Finished(Worker& worker) {
    int status = 0;
    const pid_t ended = waitpid(worker.pid, &status, WNOHANG);
    if (const auto place = worker.report->Place(); place && !std::exchange(worker.place_known, true))
      on_place_(jobs_[worker.job].folder.filename(), *place);
    if (ended == 0 || (ended < 0 && errno == EINTR)) {
      Watch(worker);
      return false;
    }
    results_[worker.job] =
        ended < 0
            ? ErrorResult(jobs_[worker.job], "the worker process is gone, and how it ended is not known")
            : Collect(worker, status);
    KeepVerdict(jobs_[worker.job], *results_[worker.job]);
    close(worker.pidfd);
    munmap(static_cast<void*>(worker.report), sizeof(WorkerReport));
    return true;
  }

  // A flight by the clock on the wall that is stopped cannot be judged: its time goes on.
  void GetsOn(Worker& worker, SteadyClock::time_point now) {
    worker.seen_at = now;
    worker.own = OwnTime(jobs_[worker.job].means.realtime ? -1 : worker.pid);
  }

  void Watch(Worker& worker) {
    const auto now = SteadyClock::now();
    const std::int64_t progress = worker.report->progress_ns.load(std::memory_order_relaxed);
    const std::uint64_t calls = worker.report->firmware.calls_count.load(std::memory_order_relaxed);
    if (std::exchange(worker.seen_progress_ns, progress) != progress ||
        std::exchange(worker.seen_calls_count, calls) != calls)
      GetsOn(worker, now);
    const TimeNs own_ns = worker.own.Look(now);
    const TimeNs excused_ns = std::chrono::nanoseconds(now - worker.seen_at).count() - own_ns;
    if (!worker.told && excused_ns > kToldAfterNs && worker.own.excuse() != OwnTime::Excuse::kNone) {
      worker.told = true;
      Tell(fmt::format("{} stands still: {}", jobs_[worker.job].folder.filename().string(),
                       worker.own.excuse() == OwnTime::Excuse::kStopped
                           ? fmt::format("process {} is stopped (`kill -CONT {}` lets it go on)",
                                         worker.own.stopped_pid(), worker.own.stopped_pid())
                           : "this machine has no processor for it"));
    }
    const FirmwareCall inside = worker.report->firmware.inside.load(std::memory_order_relaxed);
    if (worker.stuck || own_ns <= Limit(worker, inside)) return;
    if (inside != FirmwareCall::kNone && worker.own.stopped_itself() &&
        worker.stopped_itself_in == FirmwareCall::kNone) {
      // Its flight is kept when it leaves the call by our word.
      worker.stopped_itself_in = inside;
      worker.report->firmware.stopped_itself = true;
      kill(worker.pid, SIGALRM);
      kill(worker.pid, SIGCONT);
      GetsOn(worker, now);
      return;
    }
    worker.stuck = true;
    worker.stuck_in = inside;
    kill(worker.pid, SIGKILL);
  }

  TimeNs Limit(const Worker& worker, FirmwareCall inside) const {
    const FlightJob& job = jobs_[worker.job];
    if (job.means.realtime) return kRealtimeStuckAfterNs + job.scenario.duration_ns;
    if (inside == FirmwareCall::kNone) return kStuckAfterNs;
    return worker.stopped_itself_in == FirmwareCall::kNone ? FirmwareGuard::kUnreachableAfterNs
                                                           : kLastChanceNs;
  }

  // Why a flight stands still, to the user: that time is not counted.
  void Tell(const std::string& text) {
    ClearProgress();
    Print(stderr, "tiltproof: {}; that time does not count\n", text);
  }

  // In place of a worker that could not, or could not know better.
  static void KeepVerdict(const FlightJob& job, const ScenarioResult& result) {
    const auto file = job.folder / "verdict.json";
    if (std::filesystem::exists(file)) return;
    try {
      WriteFile(file, ToJsonText(result));
    } catch (const FileError&) {
      // results.json says the same, or fails for the same reason and tells.
    }
  }

  // Of a worker that has left no verdict.
  ScenarioResult WithoutVerdict(const Worker& worker, int status) const {
    const FlightJob& job = jobs_[worker.job];
    const std::string at = fmt::format("at {:.3f} s of the flight",
                                       ToSeconds(worker.report->progress_ns.load(std::memory_order_relaxed)));
    const FirmwareCall inside = worker.report->firmware.inside.load(std::memory_order_relaxed);
    if (worker.stuck && worker.stopped_itself_in != FirmwareCall::kNone)
      return FirmwareFailed(
          job, fmt::format("the firmware stopped itself in {} {}", Name(worker.stopped_itself_in), at));
    if (worker.stuck && worker.stuck_in != FirmwareCall::kNone)
      return FirmwareFailed(
          job, fmt::format("the firmware did not return from {} within {} s of its own time, {}, "
                           "and holds off what would end the call: its flight is lost",
                           Name(worker.stuck_in), ToSeconds(FirmwareGuard::kUnreachableAfterNs), at));
    if (worker.stuck)
      return ErrorResult(job, fmt::format("the worker process stood still for {:.0f} s {} and was killed: it "
                                          "hung or was stopped",
                                          ToSeconds(Limit(worker, FirmwareCall::kNone)), at));
    if (WIFEXITED(status) && WEXITSTATUS(status) == kExitWithoutVerdict)
      return ErrorResult(
          job, fmt::format("the flight's results are missing: {}", worker.report->no_verdict_because.data()));
    const std::string how = WIFSIGNALED(status) ? fmt::format("was killed by signal {} ({})",
                                                              WTERMSIG(status), strsignal(WTERMSIG(status)))
                                                : fmt::format("ended with exit code {}", WEXITSTATUS(status));
    // These others send, too; all else is of the firmware's making while it runs. The worker itself does not exit
    // without a verdict.
    const std::array others = {SIGKILL, SIGTERM, SIGINT, SIGHUP, SIGQUIT};
    const bool by_others =
        WIFSIGNALED(status) && (inside == FirmwareCall::kNone ||
                                std::find(others.begin(), others.end(), WTERMSIG(status)) != others.end());
    if (job.means.FirmwareInWorker(job.scenario) && !by_others)
      return FirmwareFailed(job,
                            fmt::format("the firmware ended its process in {}: the process {} {}, and the "
                                        "flight is lost",
                                        Name(inside), how, at));
    return ErrorResult(job, fmt::format("the worker process {} {}", how, at));
  }

  ScenarioResult Collect(const Worker& worker, int status) {
    const FlightJob& job = jobs_[worker.job];
    const auto file = job.folder / "verdict.json";
    if (!std::filesystem::exists(file)) return WithoutVerdict(worker, status);
    try {
      if (!WIFEXITED(status) || (WEXITSTATUS(status) != 0 && WEXITSTATUS(status) != kExitWorkerInterrupted)) {
        ClearProgress();
        Print(stderr,
              "tiltproof: warning: {}: after the flight, which counts as it was, its process did not end "
              "in order{}\n",
              job.folder.filename().string(),
              worker.stuck_in == FirmwareCall::kNone ? ""
                                                     : fmt::format(": it hung in {}", Name(worker.stuck_in)));
      }
      ScenarioResult result = ResultFromJsonText(ReadFile(file));
      // Nobody asked this run to end, only its worker: that is trouble, not a wish.
      if (WIFEXITED(status) && WEXITSTATUS(status) == kExitWorkerInterrupted && !interrupted) {
        result.score.verdict = Verdict::kError;
        result.score.reason = fmt::format("a signal ended the worker process alone: {}", result.score.reason);
        std::filesystem::remove(file);
      }
      return result;
    } catch (const std::exception& error) {
      return ErrorResult(job, error.what());
    }
  }

  void ShowProgress() {
    if (!options_.progress || workers_.empty()) return;
    std::string line;
    for (const auto& worker : workers_)
      line += fmt::format("  {} {:.0f}/{:.0f} s", jobs_[worker.job].folder.filename().string(),
                          ToSeconds(worker.report->progress_ns.load(std::memory_order_relaxed)),
                          ToSeconds(jobs_[worker.job].scenario.duration_ns));
    Print(stderr, "\r\033[K{}", line.substr(0, 110));
    std::fflush(stderr);
    shown_ = true;
  }
  void ClearProgress() {
    if (shown_) Print(stderr, "\r\033[K");
    shown_ = false;
  }

  const std::vector<FlightJob>& jobs_;
  const PoolOptions& options_;
  const std::function<void(const ScenarioResult&)>& on_finished_;
  const std::function<void()>& on_turn_;
  const std::function<void(const std::string&, const BusPlace&)>& on_place_;
  std::vector<std::optional<ScenarioResult>> results_;
  std::vector<Worker> workers_;
  bool forwarded_ = false;
  bool shown_ = false;
};

}  // namespace

std::vector<ClientSpec> FlightMeans::ClientsOf(const Scenario& scenario) const {
  std::vector<ClientSpec> specs;
  for (std::size_t i = 0; i < scenario.client_count(); ++i)
    specs.push_back(clients.Of(scenario.client_id(i)));
  return specs;
}

bool FlightMeans::FirmwareInWorker(const Scenario& scenario) const {
  return !realtime && !distributed && !scenario.has_several_clients() &&
         AbilitiesOf(ClientsOf(scenario).front(), realtime).guarded;
}

PoolOutcome FlyAll(const std::vector<FlightJob>& jobs, const PoolOptions& options,
                   const std::function<void(const ScenarioResult&)>& on_finished,
                   const std::function<void()>& on_turn,
                   const std::function<void(const std::string&, const BusPlace&)>& on_place) {
  return Pool(jobs, options, on_finished, on_turn, on_place).Run();
}

}  // namespace tiltproof::harness
