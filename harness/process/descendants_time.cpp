#include "harness/process/descendants_time.h"

#include <sys/resource.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <system_error>
#include <vector>

namespace tiltproof::harness {
namespace {

// Processor time of the children that this process has waited for.
TimeNs WaitedByUs() {
  rusage waited{};
  getrusage(RUSAGE_CHILDREN, &waited);
  const auto in_ns = [](const timeval& time) { return time.tv_sec * kNsPerS + time.tv_usec * kNsPerUs; };
  return in_ns(waited.ru_utime) + in_ns(waited.ru_stime);
}

// Its own time, exactly.
TimeNs RunTime(pid_t pid) {
  clockid_t clock{};
  timespec time{};
  if (clock_getcpuclockid(pid, &clock) != 0 || clock_gettime(clock, &time) != 0) return 0;
  return time.tv_sec * kNsPerS + time.tv_nsec;
}

// Processor time of the children that it has waited for (proc(5), stat: cutime and cstime), in whole ticks.
TimeNs WaitedTime(pid_t pid) {
  constexpr int kState = 3, kChildUserTime = 16, kChildSystemTime = 17;
  std::ifstream file("/proc/" + std::to_string(pid) + "/stat");
  std::string text;
  std::getline(file, text, '\0');
  // The program's name, in parentheses, may hold anything.
  const std::size_t name_end = text.rfind(')');
  if (name_end == text.npos) return 0;
  std::istringstream rest(text.substr(name_end + 1));
  TimeNs ticks = 0;
  std::string field;
  for (int i = kState; i <= kChildSystemTime && rest >> field; ++i)
    if (i >= kChildUserTime) ticks += std::strtoll(field.c_str(), nullptr, 10);
  return ticks * (kNsPerS / sysconf(_SC_CLK_TCK));
}

std::vector<pid_t> ChildrenOf(pid_t pid) {
  std::vector<pid_t> children;
  std::error_code error;
  const std::filesystem::path tasks = "/proc/" + std::to_string(pid) + "/task";
  for (std::filesystem::directory_iterator task(tasks, error);
       !error && task != std::filesystem::directory_iterator(); task.increment(error)) {
    std::ifstream list(task->path() / "children");
    for (pid_t child = 0; list >> child;) children.push_back(child);
  }
  return children;
}

}  // namespace

std::vector<pid_t> DescendantsOf(pid_t pid) {
  std::vector<pid_t> family = ChildrenOf(pid);
  for (std::size_t i = 0; i < family.size() && i < kDescendantsMax; ++i) {
    const std::vector<pid_t> children = ChildrenOf(family[i]);
    family.insert(family.end(), children.begin(), children.end());
  }
  family.resize(std::min(family.size(), kDescendantsMax));
  return family;
}

DescendantsTime LookAtDescendants() {
  DescendantsTime all;
  all.run_min_ns = WaitedByUs();
  // A program that starts more is judged by these.
  const std::vector<pid_t> family = DescendantsOf(getpid());
  TimeNs run_ns = 0;
  for (const pid_t pid : family) {
    all.run_min_ns += WaitedTime(pid);
    run_ns += RunTime(pid);
  }
  all.processes_count = static_cast<std::int64_t>(family.size());
  all.run_min_ns += run_ns;
  all.run_max_ns = run_ns;
  for (const pid_t pid : family) all.run_max_ns += WaitedTime(pid);
  all.run_max_ns += WaitedByUs();
  return all;
}

}  // namespace tiltproof::harness
