#include "harness/engine/worker_process.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <utility>

#include "harness/engine/trunk.h"
#include "harness/engine/worker.h"
#include "harness/process/orphans.h"

namespace tiltproof::harness {
namespace {

// A worker whose simulation time has stood still for so much time of its own, at most, is stuck in our code: its firmware is
// guarded (FirmwareGuard).
constexpr TimeNs kStuckAfterNs = 300 * kNsPerS;
// One that has been stopped by its firmware is given so long to leave the call, once it goes on.
constexpr TimeNs kLastChanceNs = kNsPerS;
// It makes progress with every step, and in real time on every turn of its loop, so that only scoring and writing, which grow
// with the flight, can take a while: as long as the flight, and so much more.
constexpr TimeNs kStuckAtLeastNs = 10 * kNsPerS;

// The result of a firmware that took its flight with it.
FlightResult FirmwareFailed(const FlightJob& job, Outcome outcome, const FirmwareEnd& end,
                            const std::string& reason) {
  FlightResult result = ErrorResult(job, reason);
  result.firmware_end = end;
  result.outcome = outcome;
  result.score.verdict = Verdict::kFail;
  result.score.cause = VerdictCause::kFirmware;
  return result;
}

}  // namespace

WorkerProcess::~WorkerProcess() {
  if (pid_ > 0) {
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
    ForgetChild(std::exchange(pid_, -1));
    EndOrphans();
  }
  if (pidfd_ >= 0) close(pidfd_);
  if (channel_ >= 0) close(channel_);
  if (report_ != nullptr) munmap(static_cast<void*>(report_), sizeof(WorkerReport));
}

std::string WorkerProcess::Start(const FlightJob& job, const std::atomic<bool>* interrupted,
                                 const KnownJobs& known) {
  void* shared =
      mmap(nullptr, sizeof(WorkerReport), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (shared == MAP_FAILED) return fmt::format("cannot share memory with a worker: {}", std::strerror(errno));
  report_ = new (shared) WorkerReport();
  std::array<int, 2> ends{};
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0)
    return fmt::format("cannot open a socket to a worker: {}", std::strerror(errno));
  channel_ = ends[0];
  fcntl(channel_, F_SETFL, O_NONBLOCK);
  std::fflush(nullptr);
  // When the worker is killed, this process inherits the processes that the firmware left behind.
  AdoptOrphans();
  const pid_t parent = getpid();
  const pid_t pid = fork();
  if (pid == 0) {
    // A worker never outlives the run, not even when the parent is killed.
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (getppid() != parent) _exit(1);
    close(ends[0]);
    Work(job, *report_, ends[1], interrupted, known);
  }
  const int error = errno;
  close(ends[1]);
  if (pid < 0) return fmt::format("cannot start a worker: {}", std::strerror(error));
  pid_ = pid;
  KeepChild(pid_);
  pidfd_ = static_cast<int>(syscall(SYS_pidfd_open, pid_, 0));
  known_numbers_end_ = known.numbers_end;
  if (job.departure) trunk_ = job.departure->trunk;
  Begin(job);
  return {};
}

bool WorkerProcess::CanGoOn(const FlightJob& job, std::uint64_t number) const {
  if (!waits_) return false;
  if (!trunk_.empty()) return job.departure && job.departure->trunk == trunk_;
  return number < known_numbers_end_ && job.means.SharesWorker(job.scenario);
}

void WorkerProcess::GoOn(const FlightJob& job, std::uint64_t number) {
  waits_ = false;
  report_ = new (report_) WorkerReport();
  report_->begun = false;
  Begin(job);
  // When it is gone, Look() finds that.
  if (trunk_.empty()) {
    send(channel_, &number, sizeof number, MSG_NOSIGNAL);
  } else {
    const std::vector<std::uint8_t> fault = GivenFault(job);
    send(channel_, fault.data(), fault.size(), MSG_NOSIGNAL);
  }
}

void WorkerProcess::Begin(const FlightJob& job) {
  result_bytes_.clear();
  seen_progress_ns_ = 0;
  seen_calls_count_ = 0;
  told_ = place_known_ = false;
  stopped_itself_in_ = FirmwareCall::kNone;
  GetsOn(job, SteadyClock::now());
}

void WorkerProcess::Send(int signal) const { kill(pid_, signal); }

TimeNs WorkerProcess::progress_ns() const { return report_->progress_ns.load(std::memory_order_relaxed); }

std::optional<BusPlace> WorkerProcess::PollPlace() {
  if (place_known_) return std::nullopt;
  const auto place = report_->Place();
  place_known_ = place.has_value();
  return place;
}

std::optional<FlightResult> WorkerProcess::Look(const FlightJob& job,
                                                const std::function<void(const std::string&)>& tell,
                                                bool interrupted) {
  int status = 0;
  const pid_t ended = waitpid(pid_, &status, WNOHANG);
  ReadResult();
  if (ended == 0 || (ended < 0 && errno == EINTR)) {
    waits_ = !stuck_ && AsksForNext(result_bytes_);
    if (waits_) return Collect(job, 0, tell, interrupted);
    if (interrupted) GiveUp(job);
    // With a debugger it waits as long as its user thinks.
    if (!job.means.debug) Watch(job, tell);
    return std::nullopt;
  }
  ForgetChild(std::exchange(pid_, -1));
  EndOrphans();
  left_flight_ = !report_->begun;
  if (left_flight_) return std::nullopt;
  if (ended < 0) return ErrorResult(job, "the worker process is gone, and how it ended is not known");
  return Collect(job, status, tell, interrupted);
}

void WorkerProcess::ReadResult() {
  std::array<std::uint8_t, 65536> some;
  while (!result_ended_) {
    const ssize_t count = read(channel_, some.data(), some.size());
    if (count < 0 && errno == EINTR) continue;
    result_ended_ = count == 0;
    if (count <= 0) return;
    result_bytes_.insert(result_bytes_.end(), some.begin(), some.begin() + count);
  }
}

// A flight by the clock on the wall that is stopped cannot be judged: its time goes on.
void WorkerProcess::GetsOn(const FlightJob& job, SteadyClock::time_point now) {
  seen_at_ = now;
  own_ = OwnTime(job.means.realtime ? -1 : pid_);
}

// A worker that is asked to end does so with its next step: but not in a debugger, nor in a call into a firmware that does not
// return, nor while it waits for a process that is stopped.
void WorkerProcess::GiveUp(const FlightJob& job) {
  constexpr std::chrono::seconds kLimit{1};
  const auto now = SteadyClock::now();
  const std::uint64_t calls = report_->firmware.calls_count.load(std::memory_order_relaxed);
  const FirmwareCall inside = report_->firmware.inside.load(std::memory_order_relaxed);
  const bool stands = own_.excuse() == OwnTime::Excuse::kStopped ||
                      (inside != FirmwareCall::kNone && calls == interrupted_in_);
  if (!interrupted_at_ || (!job.means.debug && !stands)) {
    interrupted_at_ = now;
    interrupted_in_ = calls;
  }
  if (given_up_ || now - *interrupted_at_ < kLimit) return;
  given_up_ = true;
  stuck_in_ = inside;
  Send(SIGKILL);
}

void WorkerProcess::Watch(const FlightJob& job, const std::function<void(const std::string&)>& tell) {
  const auto now = SteadyClock::now();
  const TimeNs progress = progress_ns();
  const std::uint64_t calls = report_->firmware.calls_count.load(std::memory_order_relaxed);
  if (std::exchange(seen_progress_ns_, progress) != progress ||
      std::exchange(seen_calls_count_, calls) != calls)
    GetsOn(job, now);
  const TimeNs own_ns = own_.Look(now);
  const TimeNs excused_ns = std::chrono::nanoseconds(now - seen_at_).count() - own_ns;
  if (!told_ && excused_ns > kToldAfterNs && own_.excuse() != OwnTime::Excuse::kNone) {
    told_ = true;
    tell(fmt::format("{} does not run: {}; that time does not count", job.name,
                     own_.excuse() == OwnTime::Excuse::kStopped
                         ? fmt::format("process {} is stopped (`kill -CONT {}` lets it go on)",
                                       own_.stopped_pid(), own_.stopped_pid())
                         : "this machine has no processor for it"));
  }
  const FirmwareCall inside = report_->firmware.inside.load(std::memory_order_relaxed);
  if (stuck_ || own_ns <= Limit(job, inside)) return;
  if (inside != FirmwareCall::kNone && own_.stopped_itself() && stopped_itself_in_ == FirmwareCall::kNone) {
    // Its flight is kept when it leaves the call by our word.
    stopped_itself_in_ = inside;
    report_->firmware.stopped_itself = true;
    Send(SIGALRM);
    Send(SIGCONT);
    GetsOn(job, now);
    return;
  }
  stuck_ = true;
  stuck_in_ = inside;
  Send(SIGKILL);
}

TimeNs WorkerProcess::Limit(const FlightJob& job, FirmwareCall inside) const {
  if (job.means.realtime) return kStuckAtLeastNs + job.scenario.duration_ns;
  if (inside == FirmwareCall::kNone)
    return job.means.FirmwareInWorker(job.scenario)
               ? std::min(kStuckAfterNs, kStuckAtLeastNs + job.scenario.duration_ns)
               : kStuckAfterNs;
  return stopped_itself_in_ == FirmwareCall::kNone ? FirmwareGuard::kUnreachableAfterNs : kLastChanceNs;
}

FlightResult WorkerProcess::Collect(const FlightJob& job, int status,
                                    const std::function<void(const std::string&)>& tell,
                                    bool interrupted) const {
  try {
    auto done = ReadWorkerResult(result_bytes_);
    if (!done) {
      FlightResult lost = WithoutResult(job, status);
      lost.events.push_back({ToSeconds(progress_ns()), std::string(kLostEvent), std::nullopt, ""});
      return lost;
    }
    // A trunk knows the job with which it began.
    done->result.name = job.name;
    done->result.replay = job.replay;
    if (!WIFEXITED(status) || WEXITSTATUS(status) != 0)
      tell(fmt::format(
          "warning: {}: after the flight, which counts as it was, its process did not end in order{}",
          job.name, stuck_in_ == FirmwareCall::kNone ? "" : fmt::format(": it hung in {}", Name(stuck_in_))));
    // The end of this one flight was not asked for: that is trouble, not a wish.
    if (done->cut_short && !interrupted) {
      done->result.score.verdict = Verdict::kError;
      done->result.score.cause = VerdictCause::kHarness;
      done->result.outcome = Outcome::kError;
      done->result.score.reason =
          fmt::format("a signal ended the worker process alone: {}", done->result.score.reason);
      done->result.events.push_back({ToSeconds(progress_ns()), std::string(kEndedBySignalEvent), std::nullopt,
                                     "a signal that asks the process to end"});
    }
    return std::move(done->result);
  } catch (const std::exception& error) {
    return ErrorResult(job, error.what());
  }
}

FlightResult WorkerProcess::WithoutResult(const FlightJob& job, int status) const {
  const std::string at = fmt::format("at {:.3f} s of the flight", ToSeconds(progress_ns()));
  const FirmwareCall inside = report_->firmware.inside.load(std::memory_order_relaxed);
  if (given_up_)
    return ErrorResult(
        job, job.means.debug ? fmt::format("interrupted in a debugger, or while it waited for one, {}", at)
             : stuck_in_ == FirmwareCall::kNone
                 ? fmt::format("interrupted while a process of the flight was stopped, {}", at)
                 : fmt::format("interrupted while the firmware was in {}, {}", Name(stuck_in_), at));
  if (stuck_ && stopped_itself_in_ != FirmwareCall::kNone)
    return FirmwareFailed(job, Outcome::kHung, {.kind = FirmwareEndKind::kInOwnCode},
                          fmt::format("the firmware stopped itself in {} {}", Name(stopped_itself_in_), at));
  if (stuck_ && stuck_in_ != FirmwareCall::kNone)
    return FirmwareFailed(job, Outcome::kHung, {.kind = FirmwareEndKind::kInOwnCode},
                          fmt::format("the firmware did not return from {} within {} s of its own time, {}, "
                                      "and holds off what would end the call: its flight is lost",
                                      Name(stuck_in_), ToSeconds(FirmwareGuard::kUnreachableAfterNs), at));
  if (stuck_)
    return FailedOutsideCalls(job,
                              fmt::format("the worker process stood still for {:.0f} s {} and was killed: it "
                                          "hung or was stopped",
                                          ToSeconds(Limit(job, FirmwareCall::kNone)), at),
                              progress_ns());
  const bool not_handed_over = WIFEXITED(status) && WEXITSTATUS(status) == kExitWithoutResult;
  if (not_handed_over && job.means.FirmwareInWorker(job.scenario))
    return FirmwareFailed(
        job, Outcome::kCrashed, {.kind = FirmwareEndKind::kInOwnCode},
        "the firmware closed descriptors of its process, the one for the results among them: "
        "the flight is lost");
  if (not_handed_over)
    return ErrorResult(job, fmt::format("the flight's results are missing: the worker process could not hand "
                                        "them over; its descriptor for them was closed, {}",
                                        at));
  const std::string how = WIFSIGNALED(status) ? fmt::format("was killed by signal {} ({})", WTERMSIG(status),
                                                            strsignal(WTERMSIG(status)))
                                              : fmt::format("ended with exit code {}", WEXITSTATUS(status));
  // These others send, too; all else is of the firmware's making while it runs. The worker itself does not exit
  // without a result.
  const std::array others = {SIGKILL, SIGTERM, SIGINT, SIGHUP, SIGQUIT};
  const bool by_others =
      WIFSIGNALED(status) && (inside == FirmwareCall::kNone ||
                              std::find(others.begin(), others.end(), WTERMSIG(status)) != others.end());
  if (const CodePlace& place = report_->firmware.thread_crash_place; place.known())
    return FirmwareFailed(
        job, Outcome::kCrashed, {.kind = FirmwareEndKind::kInThread, .place = place.at.data()},
        fmt::format("a thread that the firmware started crashed{}: the process {} {}, and the "
                    "flight is lost",
                    place.text(), how, at));
  if (job.means.FirmwareInWorker(job.scenario) && !by_others)
    // A signal of a crash is caught in the firmware's own code: this one came in a call back.
    return FirmwareFailed(
        job, Outcome::kCrashed,
        {.kind = WIFSIGNALED(status) ? FirmwareEndKind::kInCallBack : FirmwareEndKind::kInOwnCode},
        fmt::format("the firmware ended its process in {}: the process {} {}, and the "
                    "flight is lost",
                    Name(inside), how, at));
  const std::string what = fmt::format("the worker process {} {}", how, at);
  const std::array crashes = {SIGABRT, SIGSEGV, SIGBUS, SIGFPE, SIGILL};
  const bool crashed =
      WIFSIGNALED(status) && std::find(crashes.begin(), crashes.end(), WTERMSIG(status)) != crashes.end();
  if (crashed) return FailedOutsideCalls(job, what, progress_ns());
  FlightResult result = ErrorResult(job, what);
  if (inside != FirmwareCall::kNone)
    result.events.push_back({ToSeconds(progress_ns()), std::string(kEndedBySignalEvent), std::nullopt,
                             fmt::format("the process {} in {}", how, Name(inside))});
  return result;
}

}  // namespace tiltproof::harness
