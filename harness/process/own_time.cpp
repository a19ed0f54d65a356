#include "harness/process/own_time.h"

#include <fmt/format.h>
#include <poll.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

namespace tiltproof::harness {
namespace {

// Deeper, and longer, is no family of ours.
constexpr int kGenerationsMax = 8;

// Empty when it cannot be read, as when the process has ended meanwhile.
std::string ReadAll(const std::string& file) {
  std::ifstream stream(file);
  std::string text;
  std::getline(stream, text, '\0');
  return text;
}

struct Stat {
  char state = '\0';  // R, S, D, T, t, Z, ...; 0 when there is none
  TimeNs run_ns = 0;
};

// Reads the state of a process or a thread from the file `stat` in its folder (proc(5)).
Stat ReadStat(const std::string& folder) {
  const std::string text = ReadAll(folder + "/stat");
  // The program's name, in parentheses, may hold anything.
  const std::size_t name_end = text.rfind(')');
  if (name_end == text.npos || name_end + 2 >= text.size()) return {};
  Stat stat;
  std::istringstream rest(text.substr(name_end + 2));
  rest >> stat.state;
  constexpr int kUserTime = 14, kSystemTime = 15;  // in ticks
  long long ticks = 0;
  std::string field;
  for (int i = 4; i <= kSystemTime && rest >> field; ++i)
    if (i >= kUserTime) ticks += std::strtoll(field.c_str(), nullptr, 10);
  stat.run_ns = ticks * (kNsPerS / sysconf(_SC_CLK_TCK));
  return stat;
}

bool IsStoppedState(char state) { return state == 'T' || state == 't'; }

template <class Visit>
void ForEachThread(pid_t pid, const Visit& visit) {
  std::error_code error;
  for (std::filesystem::directory_iterator task(fmt::format("/proc/{}/task", pid), error);
       !error && task != std::filesystem::directory_iterator(); task.increment(error))
    visit(task->path().string());
}

// A process and all that it has started.
struct Family {
  bool running = false;  // a thread runs, or is ready to
  pid_t stopped_pid = -1;
  bool stopped_itself = false;
  TimeNs run_ns = 0;
};

void Look(pid_t pid, int generation, Family& family) {
  const Stat whole = ReadStat(fmt::format("/proc/{}", pid));
  family.run_ns += whole.run_ns;
  if (IsStoppedState(whole.state)) {
    family.stopped_pid = pid;
    family.stopped_itself = family.stopped_itself || HasStoppedItself(pid);
  }
  std::vector<pid_t> children;
  ForEachThread(pid, [&](const std::string& folder) {
    family.running = family.running || ReadStat(folder).state == 'R';
    std::istringstream list(ReadAll(folder + "/children"));
    std::copy(std::istream_iterator<pid_t>(list), {}, std::back_inserter(children));
  });
  if (generation < kGenerationsMax)
    for (const pid_t child : children) Look(child, generation + 1, family);
}

}  // namespace

TimeNs OwnTime::OwnDelay::operator()() {
  TimeNs longest_ns = 0;
  ForEachThread(getpid(), [&](const std::string& folder) {
    // Times on a processor and waiting for one, in ns (kernel documentation, sched-stats).
    TimeNs run_ns = 0, delay_ns = 0;
    if (!(std::istringstream(ReadAll(folder + "/schedstat")) >> run_ns >> delay_ns)) return;
    const auto [thread, is_new] = threads_.try_emplace(folder, delay_ns);
    longest_ns = std::max(longest_ns, delay_ns - std::exchange(thread->second, delay_ns));
  });
  return longest_ns;
}

TimeNs OwnTime::Look(SteadyClock::time_point now) {
  if (looks_count_ > 0 && now - last_ < kLook / 2) return own_ns_;
  const TimeNs elapsed_ns = std::min<TimeNs>(std::chrono::nanoseconds(now - last_).count(),
                                             std::chrono::nanoseconds(2 * kLook).count());
  last_ = now;
  const int looks = looks_count_++;
  if (looks == 0) return 0;
  const TimeNs heard_ns = std::max(elapsed_ns - observer_delay_(), elapsed_ns / kLeastShare);
  if (pid_ < 0) return own_ns_ += heard_ns;
  Family family;
  harness::Look(pid_, 0, family);
  const TimeNs run_ns = std::max<TimeNs>(family.run_ns - std::exchange(run_ns_, family.run_ns), 0);
  if (looks == 1) return 0;
  stopped_pid_ = family.stopped_pid;
  stopped_itself_ = family.stopped_itself;
  TimeNs own_ns = heard_ns;
  excuse_ = Excuse::kNone;
  if (family.stopped_pid >= 0) {
    if (!family.stopped_itself) {
      own_ns = 0;
      excuse_ = Excuse::kStopped;
    }
  } else if (family.running) {
    own_ns = std::min(heard_ns, run_ns);
    if (2 * own_ns < elapsed_ns) excuse_ = Excuse::kNoProcessor;
  }
  return own_ns_ += own_ns;
}

TimeNs ProcessorTime(pid_t pid) {
  clockid_t clock{};
  timespec time{};
  if (clock_getcpuclockid(pid, &clock) != 0 || clock_gettime(clock, &time) != 0) return 0;
  return time.tv_sec * kNsPerS + time.tv_nsec;
}

Input AwaitInput(int descriptor, pid_t pid, TimeNs limit_ns, OnSignal on_signal) {
  OwnTime own(pid);
  for (;;) {
    const bool over = own.Look(OwnTime::SteadyClock::now()) >= limit_ns;
    pollfd polled{descriptor, POLLIN, 0};
    const int ready = poll(&polled, 1, over ? 0 : static_cast<int>(OwnTime::kLook.count()));
    if (ready > 0) return Input::kReady;
    if (ready < 0 && errno == EINTR && on_signal == OnSignal::kReturn) return Input::kInterrupted;
    if (ready < 0 && errno != EINTR)
      throw std::system_error(errno, std::generic_category(), "waiting for another process");
    if (ready == 0 && over) return own.stopped_itself() ? Input::kStoppedItself : Input::kSilent;
  }
}

bool IsStopped(pid_t pid) { return IsStoppedState(ReadStat(fmt::format("/proc/{}", pid)).state); }

bool IsStoppedByOthers(pid_t pid) {
  Family family;
  Look(pid, 0, family);
  return family.stopped_pid >= 0 && !family.stopped_itself;
}

bool HasStoppedItself(pid_t pid) {
  bool itself = false;
  ForEachThread(pid, [&](const std::string& folder) {
    // "234 0x6413 0x6413 0x13 ...": the call's number and its arguments.
    std::istringstream text(ReadAll(folder + "/syscall"));
    long call = -1;
    std::array<std::string, 3> words;
    if (!(text >> call >> words[0] >> words[1] >> words[2])) return;
    std::array<long, 3> arguments{};
    std::transform(words.begin(), words.end(), arguments.begin(),
                   [](const std::string& word) { return std::strtol(word.c_str(), nullptr, 16); });
    long target = -1, signal_number = 0;
    if (call == SYS_kill || call == SYS_tkill) {
      target = arguments[0];
      signal_number = arguments[1];
    } else if (call == SYS_tgkill) {
      target = arguments[0];
      signal_number = arguments[2];
    }
    const bool stops = signal_number == SIGSTOP || signal_number == SIGTSTP || signal_number == SIGTTIN ||
                       signal_number == SIGTTOU;
    const bool to_itself = target == pid || folder.ends_with(fmt::format("/{}", target));
    itself = itself || (stops && to_itself);
  });
  return itself && IsStopped(pid);
}

}  // namespace tiltproof::harness
