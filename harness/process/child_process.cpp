#include "harness/process/child_process.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/close_range.h>
#include <poll.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <string_view>

#include "harness/process/orphans.h"

namespace tiltproof::harness {
namespace {

using std::chrono::milliseconds;
using SteadyClock = std::chrono::steady_clock;

// A process in the middle of a broken driver's call does not even heed SIGKILL; we do not wait for ever.
constexpr milliseconds kKillWait{5000};
constexpr int kExitNotStarted = 127;

// A descriptor of ours that is closed when the start is over or has failed.
class Descriptor {
 public:
  explicit Descriptor(int value = -1) : value_(value) {}
  Descriptor(Descriptor&& other) noexcept : value_(other.Release()) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(value_, other.value_);
    return *this;
  }
  ~Descriptor() {
    if (value_ >= 0) close(value_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const { return value_; }
  int Release() { return std::exchange(value_, -1); }

 private:
  int value_;
};

[[noreturn]] void Refuse(const ChildSpec& spec, const std::string& why) {
  throw std::runtime_error(
      fmt::format("cannot start '{}': {}", spec.command.empty() ? "" : spec.command[0], why));
}

bool IsProgram(const std::string& path) {
  struct stat status {};
  return stat(path.c_str(), &status) == 0 && S_ISREG(status.st_mode) && access(path.c_str(), X_OK) == 0;
}

// As execvp looks it up; here, since execvp may not be called in the child of a process with threads.
std::string FindProgram(const ChildSpec& spec) {
  if (spec.command.empty() || spec.command[0].empty()) Refuse(spec, "the command is empty");
  for (const auto& word : spec.command)
    if (word.find('\0') != std::string::npos) Refuse(spec, "the command holds a zero byte");
  const std::string& name = spec.command[0];
  if (name.find('/') != std::string::npos) return name;
  const char* path = std::getenv("PATH");
  std::string_view rest = path != nullptr ? path : "/usr/local/bin:/usr/bin:/bin";
  while (true) {
    const auto colon = rest.find(':');
    const std::string folder(rest.substr(0, colon));
    const std::string candidate = (folder.empty() ? "." : folder) + "/" + name;
    if (IsProgram(candidate)) return candidate;
    if (colon == std::string_view::npos) break;
    rest.remove_prefix(colon + 1);
  }
  throw NoSuchProgram(fmt::format("cannot start '{}': no such program in PATH", name));
}

std::vector<std::string> Environment(const ChildSpec& spec) {
  std::vector<std::string> entries;
  for (char** entry = environ; *entry != nullptr; ++entry) {
    const std::string_view text(*entry);
    const std::string_view name = text.substr(0, text.find('='));
    if (std::none_of(spec.environment.begin(), spec.environment.end(),
                     [&](const auto& added) { return added.first == name; }))
      entries.emplace_back(text);
  }
  for (const auto& [name, value] : spec.environment) entries.push_back(fmt::format("{}={}", name, value));
  return entries;
}

std::vector<char*> Pointers(std::vector<std::string>& strings) {
  std::vector<char*> pointers;
  for (auto& text : strings) pointers.push_back(text.data());
  pointers.push_back(nullptr);
  return pointers;
}

struct Pipe {
  Descriptor read, write;
};
Pipe MakePipe(const ChildSpec& spec) {
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) Refuse(spec, fmt::format("no pipe: {}", std::strerror(errno)));
  return {Descriptor(ends[0]), Descriptor(ends[1])};
}

// All that the child needs between fork and execve, prepared before: there it may neither allocate nor lock.
struct Start {
  const char* program;
  char* const* arguments;
  char* const* environment;
  const int* sources;  // become descriptors 0, 1, 2, ...; all of them numbered source_count or more
  unsigned source_count;
  int trouble;   // where to write errno; as high
  pid_t parent;  // to die with; 0 for none
  int guard;     // where to write its process id as a line, before it can start another process; -1: nowhere
};

void TellGuard(int guard) {
  std::array<char, 16> line;
  auto [end, error] = std::to_chars(line.data(), line.data() + line.size() - 1, getpid());
  *end++ = '\n';
  [[maybe_unused]] const ssize_t written =
      write(guard, line.data(), static_cast<std::size_t>(end - line.data()));
}

[[noreturn]] void RunChild(const Start& start) {
  if (start.parent != 0) DieWithParent(start.parent);
  setpgid(0, 0);
  if (start.guard >= 0) TellGuard(start.guard);
  // Handlers do not survive execve, but ignored signals would.
  struct sigaction action {};
  action.sa_handler = SIG_DFL;
  for (int number = 1; number < NSIG; ++number) sigaction(number, &action, nullptr);
  bool ready = true;
  for (unsigned i = 0; i < start.source_count; ++i)
    ready = ready && dup2(start.sources[i], static_cast<int>(i)) >= 0;
  ready = ready && syscall(SYS_close_range, start.source_count, ~0U, CLOSE_RANGE_CLOEXEC) == 0;
  if (ready) {
    sigset_t none;
    sigemptyset(&none);
    sigprocmask(SIG_SETMASK, &none, nullptr);
    execve(start.program, start.arguments, start.environment);
  }
  const int error = errno;
  [[maybe_unused]] const ssize_t written = write(start.trouble, &error, sizeof error);
  _exit(kExitNotStarted);
}

// The child; signals are held back meanwhile, so that no handler of ours runs in it. vfork, since a fork
// would copy the page tables of a process that may be flying and hold hundreds of megabytes of log: the child
// borrows our memory until it runs its program, and this thread waits. RunChild writes to nothing but its own
// frame and errno.
pid_t Fork(const Start& start) {
  sigset_t all, before;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &before);
  const pid_t pid = vfork();      // NOLINT(clang-analyzer-security.insecureAPI.vfork)
  if (pid == 0) RunChild(start);  // NOLINT(clang-analyzer-unix.Vfork)
  const int error = errno;
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
  errno = error;
  return pid;
}

// errno of the child's execve, 0 when the program runs.
int ReadTrouble(int descriptor) {
  int error = 0;
  ssize_t count = 0;
  do count = read(descriptor, &error, sizeof error);
  while (count < 0 && errno == EINTR);
  return count == static_cast<ssize_t>(sizeof error) ? error : 0;
}

std::string ExecTrouble(const std::string& program, int error) {
  if (error == ENOEXEC) return "not a program (a script begins with a line such as #!/bin/sh)";
  if (error == ENOENT && access(program.c_str(), F_OK) == 0)
    return "the interpreter it asks for does not exist";
  return std::strerror(error);
}

// Without real-time priority. The kernel removes the process's entries from /proc, and spins as long as
// another process is reading them. At real-time priority it may keep that process from the processor that it
// needs to finish, and spin for ever.
void Reap(pid_t pid, int flags) {
  const int policy = sched_getscheduler(0);
  sched_param parameters{}, ordinary{};
  sched_getparam(0, &parameters);
  const int plain = policy & ~SCHED_RESET_ON_FORK;
  const bool realtime = plain == SCHED_FIFO || plain == SCHED_RR;
  if (realtime) sched_setscheduler(0, SCHED_OTHER, &ordinary);
  while (waitpid(pid, nullptr, flags) < 0 && errno == EINTR) {
  }
  if (realtime) sched_setscheduler(0, policy, &parameters);
}

}  // namespace

void DieWithParent(pid_t parent) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  // It may have ended before that call.
  if (getppid() != parent) _exit(kExitNotStarted);
}

void ChildProcess::Run(const ChildSpec& spec, bool outlives_us, int guard_line) {
  const std::string program = FindProgram(spec);
  std::vector<std::string> arguments = spec.command, environment = Environment(spec);
  const std::vector<char*> argument_pointers = Pointers(arguments),
                           environment_pointers = Pointers(environment);

  const Descriptor null(open("/dev/null", O_RDWR | O_CLOEXEC));
  Pipe output, error;
  if (spec.output == ChildSpec::kPipe) output = MakePipe(spec);
  if (spec.error == ChildSpec::kPipe) error = MakePipe(spec);
  Pipe trouble = MakePipe(spec);
  const auto stream = [&](int wanted, const Pipe& pipe, int ours) {
    if (wanted == ChildSpec::kPipe) return pipe.write.get();
    if (wanted == ChildSpec::kNull) return null.get();
    return wanted == ChildSpec::kInherit ? ours : wanted;
  };
  std::vector<int> wanted = {null.get(), stream(spec.output, output, STDOUT_FILENO),
                             stream(spec.error, error, STDERR_FILENO)};
  wanted.insert(wanted.end(), spec.descriptors.begin(), spec.descriptors.end());
  // Copies above all the numbers they become, so that none is overwritten before it is its turn.
  const int first_free = static_cast<int>(wanted.size());
  std::vector<Descriptor> copies;
  std::vector<int> sources;
  for (const int descriptor : wanted) {
    int copy = fcntl(descriptor, F_DUPFD_CLOEXEC, first_free);
    // A stream of ours that is closed goes nowhere in the child too.
    if (copy < 0 && errno == EBADF && sources.size() < 3)
      copy = fcntl(null.get(), F_DUPFD_CLOEXEC, first_free);
    if (copy < 0) Refuse(spec, fmt::format("descriptor {}: {}", descriptor, std::strerror(errno)));
    copies.emplace_back(copy);
    sources.push_back(copy);
  }
  Descriptor trouble_copy(fcntl(trouble.write.get(), F_DUPFD_CLOEXEC, first_free));
  if (trouble_copy.get() < 0) Refuse(spec, std::strerror(errno));

  pid_ = Fork({program.c_str(), argument_pointers.data(), environment_pointers.data(), sources.data(),
               static_cast<unsigned>(sources.size()), trouble_copy.get(), outlives_us ? 0 : getpid(),
               guard_line});
  if (pid_ < 0) Refuse(spec, std::strerror(errno));
  trouble_copy = Descriptor();
  trouble.write = Descriptor();
  if (const int failed = ReadTrouble(trouble.read.get()); failed != 0) {
    Reap(pid_, 0);
    Refuse(spec, ExecTrouble(program, failed));
  }
  KeepChild(pid_);
  pidfd_ = static_cast<int>(syscall(SYS_pidfd_open, pid_, 0));
  if (pidfd_ < 0) {
    const int why = errno;
    Stop(kGrace);
    Refuse(spec, fmt::format("it cannot be watched: {}", std::strerror(why)));
  }
  output_ = output.read.Release();
  error_ = error.read.Release();
  for (const int end : {output_, error_})
    if (end >= 0) fcntl(end, F_SETFL, O_NONBLOCK);
}

ChildProcess::ChildProcess(const ChildSpec& spec, bool outlives_us) {
  Pipe line;
  if (spec.guard_group) {
    line = MakePipe(spec);
    // The child tells it its group. Then it waits for the end of file that our end brings, be it by our close or by
    // our death.
    const ChildSpec guard{
        .command = {"/bin/sh", "-c", "read group <&3 && { read line <&3 || kill -s KILL -- \"-$group\"; }"},
        .environment = {},
        .output = ChildSpec::kNull,
        .error = ChildSpec::kNull,
        .descriptors = {line.read.get()}};
    guard_.reset(new ChildProcess(guard, true));
    line.read = Descriptor();
  }
  try {
    Run(spec, outlives_us, line.write.get());
  } catch (...) {
    EndGuard();
    throw;
  }
  guard_line_ = line.write.Release();
}

ChildProcess::ChildProcess(const ChildSpec& spec) : ChildProcess(spec, false) {}

ChildProcess::~ChildProcess() {
  Stop(kGrace);
  for (const int descriptor : {pidfd_, output_, error_})
    if (descriptor >= 0) close(descriptor);
}

bool ChildProcess::Alive() {
  if (reaped_ || exit_text_) return false;
  siginfo_t info{};
  if (waitid(P_PID, static_cast<id_t>(pid_), &info, WEXITED | WNOHANG | WNOWAIT) != 0) {
    if (errno == EINTR) return true;
    // SIGCHLD is ignored here, or others wait for all children.
    exit_text_ = "ended, and how is not known";
    reaped_ = true;
    return false;
  }
  if (info.si_pid == 0) return true;
  if (info.si_code == CLD_EXITED) {
    exit_text_ = fmt::format("exited with code {}", info.si_status);
  } else {
    const char* name = sigdescr_np(info.si_status);
    exit_text_ = fmt::format("killed by signal {} ({})", info.si_status, name != nullptr ? name : "unknown");
  }
  return false;
}

std::optional<std::string> ChildProcess::ExitText() {
  Alive();
  return exit_text_;
}

void ChildProcess::Signal(int number) {
  if (!reaped_) kill(pid_, number);
}

void ChildProcess::SignalGroup(int number) {
  if (!reaped_) kill(-pid_, number);
}

bool ChildProcess::WaitEnd(milliseconds timeout) const {
  const auto end = SteadyClock::now() + timeout;
  while (true) {
    const auto left = std::chrono::ceil<milliseconds>(end - SteadyClock::now()).count();
    pollfd polled{pidfd_, POLLIN, 0};
    const int count = poll(&polled, 1, static_cast<int>(std::max<milliseconds::rep>(left, 0)));
    if (count > 0) return true;
    if (count == 0 || errno != EINTR) return false;
  }
}

void ChildProcess::Stop(milliseconds grace) {
  if (!reaped_) {
    if (Alive()) {
      SignalGroup(SIGTERM);
      SignalGroup(SIGCONT);
      WaitEnd(grace);
    }
    // Kills the rest of the group: the process itself, or what it started.
    SignalGroup(SIGKILL);
    if (!WaitEnd(kKillWait)) exit_text_ = "does not end, not even when killed";
    Alive();
    Reap(pid_, WNOHANG);
    reaped_ = true;
    ForgetChild(pid_);
  }
  EndGuard();
}

// Before its line ends: it would kill a group that is gone, or another of that number.
void ChildProcess::EndGuard() {
  if (guard_) {
    guard_->SignalGroup(SIGKILL);
    guard_.reset();
  }
  if (guard_line_ >= 0) close(std::exchange(guard_line_, -1));
}

}  // namespace tiltproof::harness
