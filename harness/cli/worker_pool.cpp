#include "harness/cli/worker_pool.h"

#include <fmt/format.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <functional>
#include <optional>

#include "harness/client/firmware_guard.h"
#include "harness/client/library_client.h"
#include "harness/report/files.h"
#include "harness/report/flight_files.h"
#include "harness/run/flight.h"
#include "harness/run/realtime/realtime_flight.h"
#include "harness/scenario/reader.h"

namespace tiltproof::harness {
namespace {

using SteadyClock = std::chrono::steady_clock;

// A worker whose simulation time has stood still for this long is stuck in our own code: its firmware is
// guarded (FirmwareGuard).
constexpr auto kStuckAfter = std::chrono::minutes(5);
// A conductor in real time makes progress on every turn of its loop, so that only scoring and writing, which
// grow with the flight, can take a while.
constexpr auto kRealtimeStuckAfter = std::chrono::seconds(10);
constexpr int kRefresh_ms = 100;
// Exit code of a worker that could not leave a verdict.
constexpr int kExitWithoutVerdict = 77;
// Of one whose flight was ended by a signal.
constexpr int kExitWorkerInterrupted = 78;

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

ScenarioResult ErrorResult(const FlightJob& job, const std::string& reason) {
  return MakeErrorResult(job.folder.filename(), job.scenario, reason, job.replay);
}

// What the monitors of a flight in real time are told of its score.
dds::Score Announced(const ScenarioResult& result) {
  dds::Score score;
  score.scenario = result.name;
  score.verdict = Name(result.score.verdict);
  score.reason = result.score.reason.substr(0, dds::kTextBytesMax);
  score.metrics_json = MetricsJsonText(result);
  return score;
}

// `score` makes the result, which a flight in real time announces before it leaves the bus.
RunLog FlyByMeans(const FlightJob& job, std::atomic<std::int64_t>* progress_ns,
                  const std::function<const ScenarioResult&(const RunLog&)>& score) {
  const Scenario& scenario = job.scenario;
  const FlightMeans& means = job.means;
  if (means.realtime)
    return FlyRealtime(scenario, *job.model,
                       {.program = ProgramFile(),
                        .scenario_yaml = WriteResolved(scenario),
                        .client = means.client.text,
                        .board = !means.client.device.empty(),
                        .attach = means.attach,
                        .domain = means.domain,
                        .interface = means.interface,
                        .peers = means.peers,
                        .score = [&](const RunLog& log) { return Announced(score(log)); },
                        .progress_ns = progress_ns,
                        .interrupted = &interrupted});
  if (means.distributed)
    return FlyDistributed(scenario, {.transport = *means.distributed,
                                     .program = ProgramFile(),
                                     .scenario_yaml = WriteResolved(scenario),
                                     .firmware = means.client.SourceFor(scenario),
                                     .domain = means.domain,
                                     .progress_ns = progress_ns,
                                     .interrupted = &interrupted});
  FlightOptions options;
  options.make_client = [&](ClientHost host) {
    return MakeClient(means.client.SourceFor(scenario), SettingsOf(scenario), std::move(host));
  };
  options.progress_ns = progress_ns;
  options.interrupted = &interrupted;
  return Fly(scenario, *job.model, options);
}

// `cut_short`: set when a signal ended the flight.
ScenarioResult FlyJob(const FlightJob& job, std::atomic<std::int64_t>* progress_ns, bool& cut_short) {
  const Scenario& scenario = job.scenario;
  std::optional<ScenarioResult> result;
  const auto score = [&](const RunLog& log) -> const ScenarioResult& {
    if (!result) result = MakeResult(job.folder.filename(), scenario, log, job.replay);
    return *result;
  };
  const RunLog log = FlyByMeans(job, progress_ns, score);
  cut_short = log.end_reason == EndReason::kInterrupted;
  // Scoring and writing are progress too, for whoever watches.
  progress_ns->fetch_add(1, std::memory_order_relaxed);
  score(log);
  progress_ns->fetch_add(1, std::memory_order_relaxed);
  WriteFlight(job.folder, scenario, log);
  return std::move(*result);
}

// In the worker: flies, writes the scenario's folder, exits. Never returns.
[[noreturn]] void Work(const FlightJob& job, std::atomic<std::int64_t>* progress_ns) {
  // Whatever the firmware prints must not mix with the results on standard output.
  dup2(STDERR_FILENO, STDOUT_FILENO);
  ScenarioResult result;
  bool cut_short = false;
  try {
    std::filesystem::create_directories(job.folder);
    WriteFile(job.folder / "scenario.resolved.yaml", WriteResolved(job.scenario));
    try {
      result = FlyJob(job, progress_ns, cut_short);
    } catch (const FileError&) {
      throw;
    } catch (const FirmwareTrouble& trouble) {
      // While it was being loaded; in flight the conductor keeps what was flown.
      result = ErrorResult(job, trouble.what());
      result.score.verdict = Verdict::kFail;
    } catch (const std::exception& error) {
      result = ErrorResult(job, error.what());
    }
    WriteFile(job.folder / "verdict.json", ToJsonText(result));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "tiltproof: %s: %s\n", job.scenario.name.c_str(), error.what());
    _exit(kExitWithoutVerdict);
  }
  // No destructors or exit handlers: they may be the firmware library's.
  _exit(cut_short ? kExitWorkerInterrupted : 0);
}

struct Worker {
  std::size_t job = 0;
  pid_t pid = -1;
  int pidfd = -1;
  std::atomic<std::int64_t>* progress_ns = nullptr;
  std::int64_t seen_progress_ns = 0;
  SteadyClock::time_point seen_at;
  bool stuck = false;  // and therefore killed
};

class Pool {
 public:
  Pool(const std::vector<FlightJob>& jobs, const PoolOptions& options,
       const std::function<void(const ScenarioResult&)>& on_finished, const std::function<void()>& on_turn)
      : jobs_(jobs), options_(options), on_finished_(on_finished), on_turn_(on_turn), results_(jobs.size()) {}

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
    void* shared = mmap(nullptr, sizeof(std::atomic<std::int64_t>), PROT_READ | PROT_WRITE,
                        MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (shared == MAP_FAILED)
      return fmt::format("cannot share memory with a worker: {}", std::strerror(errno));
    Worker worker;
    worker.job = job;
    worker.progress_ns = new (shared) std::atomic<std::int64_t>(0);
    worker.seen_at = SteadyClock::now();
    std::fflush(nullptr);
    const pid_t parent = getpid();
    worker.pid = fork();
    if (worker.pid < 0) {
      const int error = errno;
      munmap(shared, sizeof(std::atomic<std::int64_t>));
      return fmt::format("cannot start a worker: {}", std::strerror(error));
    }
    if (worker.pid == 0) {
      // A worker never outlives the run, not even when the parent is killed.
      prctl(PR_SET_PDEATHSIG, SIGKILL);
      if (getppid() != parent) _exit(1);
      Work(jobs_[job], worker.progress_ns);
    }
    worker.pidfd = static_cast<int>(syscall(SYS_pidfd_open, worker.pid, 0));
    workers_.push_back(worker);
    return {};
  }

  // Until a worker ends, or the time to refresh the display.
  void Wait() {
    std::vector<pollfd> polled;
    for (const auto& worker : workers_) polled.push_back({worker.pidfd, POLLIN, 0});
    poll(polled.data(), polled.size(), kRefresh_ms);
    if (interrupted && !forwarded_) {
      // Ctrl-C on a terminal reaches them anyway; a signal to this process alone does not.
      for (const auto& worker : workers_) kill(worker.pid, SIGINT);
      forwarded_ = true;
    }
  }

  bool Finished(Worker& worker) {
    int status = 0;
    const pid_t ended = waitpid(worker.pid, &status, WNOHANG);
    if (ended == 0 || (ended < 0 && errno == EINTR)) {
      const std::int64_t progress = worker.progress_ns->load(std::memory_order_relaxed);
      const auto now = SteadyClock::now();
      if (progress != worker.seen_progress_ns) {
        worker.seen_progress_ns = progress;
        worker.seen_at = now;
      } else if (!worker.stuck && now - worker.seen_at > StuckAfter(jobs_[worker.job])) {
        worker.stuck = true;
        kill(worker.pid, SIGKILL);
      }
      return false;
    }
    results_[worker.job] =
        ended < 0
            ? ErrorResult(jobs_[worker.job], "the worker process is gone, and how it ended is not known")
            : Collect(worker, status);
    KeepVerdict(jobs_[worker.job], *results_[worker.job]);
    close(worker.pidfd);
    munmap(static_cast<void*>(worker.progress_ns), sizeof(std::atomic<std::int64_t>));
    return true;
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

  static std::chrono::nanoseconds StuckAfter(const FlightJob& job) {
    if (!job.means.realtime) return kStuckAfter;
    return kRealtimeStuckAfter + std::chrono::nanoseconds(job.scenario.duration_ns);
  }

  ScenarioResult Collect(const Worker& worker, int status) const {
    const FlightJob& job = jobs_[worker.job];
    if (worker.stuck && WIFSIGNALED(status))
      return ErrorResult(job, fmt::format("the worker process stood still for {:.0f} s at {:.3f} s of the "
                                          "flight and was killed: it hung or was stopped",
                                          std::chrono::duration<double>(StuckAfter(job)).count(),
                                          ToSeconds(worker.seen_progress_ns)));
    if (WIFSIGNALED(status))
      return ErrorResult(
          job, fmt::format("the worker process was killed by signal {} ({}) at {:.3f} s of the flight",
                           WTERMSIG(status), strsignal(WTERMSIG(status)),
                           ToSeconds(worker.progress_ns->load(std::memory_order_relaxed))));
    if (WIFEXITED(status) && WEXITSTATUS(status) == kExitWithoutVerdict)
      return ErrorResult(job, "the worker process could not write the results; its message stands above");
    const auto file = job.folder / "verdict.json";
    if (!std::filesystem::exists(file))
      return ErrorResult(
          job, fmt::format(
                   "the worker process ended with exit code {} and no verdict: did the firmware call exit()?",
                   WEXITSTATUS(status)));
    try {
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
    std::string line = "\r\033[K";
    for (const auto& worker : workers_)
      line += fmt::format("  {} {:.0f}/{:.0f} s", jobs_[worker.job].folder.filename().string(),
                          ToSeconds(worker.progress_ns->load(std::memory_order_relaxed)),
                          ToSeconds(jobs_[worker.job].scenario.duration_ns));
    std::fputs(line.substr(0, 110).c_str(), stderr);
    std::fflush(stderr);
    shown_ = true;
  }
  void ClearProgress() {
    if (shown_) std::fputs("\r\033[K", stderr);
    shown_ = false;
  }

  const std::vector<FlightJob>& jobs_;
  const PoolOptions& options_;
  const std::function<void(const ScenarioResult&)>& on_finished_;
  const std::function<void()>& on_turn_;
  std::vector<std::optional<ScenarioResult>> results_;
  std::vector<Worker> workers_;
  bool forwarded_ = false;
  bool shown_ = false;
};

}  // namespace

PoolOutcome FlyAll(const std::vector<FlightJob>& jobs, const PoolOptions& options,
                   const std::function<void(const ScenarioResult&)>& on_finished,
                   const std::function<void()>& on_turn) {
  return Pool(jobs, options, on_finished, on_turn).Run();
}

}  // namespace tiltproof::harness
