#include "harness/process/cpu_wait.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <system_error>
#include <utility>

#include "harness/process/descendants_time.h"

namespace tiltproof::harness {
namespace {

// The kernel brings the counters of a thread that runs up to date with each of its ticks, at the latest.
constexpr TimeNs kTickMaxNs = 10 * kNsPerMs;

std::string ReadAll(int descriptor) {
  std::array<char, 512> text;
  const ssize_t size = pread(descriptor, text.data(), text.size(), 0);
  return {text.data(), static_cast<std::size_t>(std::max<ssize_t>(size, 0))};
}

}  // namespace

// Three numbers: nanoseconds run, nanoseconds spent waiting to run, how often it has run
// (Documentation/scheduler/sched-stats.rst of Linux).
std::optional<CpuWait::Waits> CpuWait::Read(int descriptor) {
  const std::string text = ReadAll(descriptor);
  if (text.empty()) return std::nullopt;
  Waits waits;
  char* rest = nullptr;
  waits.run_ns = std::strtoll(text.c_str(), &rest, 10);
  waits.total_ns = std::strtoll(rest, &rest, 10);
  waits.count = std::strtoll(rest, &rest, 10);
  return waits;
}

// The state follows the name, which is in parentheses and may hold anything (proc(5)).
bool CpuWait::IsReady(int descriptor) {
  const std::string text = ReadAll(descriptor);
  const std::size_t name_end = text.rfind(')');
  return name_end != text.npos && name_end + 2 < text.size() && text[name_end + 2] == 'R';
}

CpuWait::CpuWait(pid_t pid, Of of) : pid_(pid), of_(of) {
  // A kernel that does not count has zeros there.
  const link::OwnedDescriptor own(open("/proc/thread-self/schedstat", O_RDONLY | O_CLOEXEC));
  const auto seen = Read(own.get());
  counts_ = seen && seen->count > 0;
  if (counts_) Look();
}

void CpuWait::Look() {
  LookAt(pid_);
  if (of_ == Of::kFamily)
    for (const pid_t child : DescendantsOf(pid_)) LookAt(child);
}

void CpuWait::LookAt(pid_t pid) {
  std::error_code error;
  const std::filesystem::path tasks = std::filesystem::path("/proc") / std::to_string(pid) / "task";
  for (std::filesystem::directory_iterator task(tasks, error);
       !error && task != std::filesystem::directory_iterator() && threads_.size() < kThreadsMax;
       task.increment(error)) {
    const std::string id = task->path().filename();
    if (threads_.contains(id)) continue;
    link::OwnedDescriptor schedstat(open((task->path() / "schedstat").c_str(), O_RDONLY | O_CLOEXEC));
    link::OwnedDescriptor stat(open((task->path() / "stat").c_str(), O_RDONLY | O_CLOEXEC));
    if (schedstat.get() < 0 || stat.get() < 0) continue;
    if (const auto seen = Read(schedstat.get()))
      threads_.emplace(id, Thread{pid, std::move(schedstat), std::move(stat), *seen});
  }
}

TimeNs CpuWait::Take(TimeNs since_last_ns) {
  if (!counts_) return 0;
  std::map<pid_t, TimeNs> waited_ns;  // by process
  for (auto it = threads_.begin(); it != threads_.end();) {
    Thread& thread = it->second;
    const auto read = Read(thread.schedstat.get());
    if (!read) {  // it has ended
      it = threads_.erase(it);
      continue;
    }
    const Waits now = *read;
    const Waits before = std::exchange(thread.seen, now);
    TimeNs& total_ns = waited_ns[thread.pid];
    ++it;
    if (now == before && IsReady(thread.stat.get())) {
      thread.still_ns += since_last_ns;
      if (thread.still_ns > kTickMaxNs)
        total_ns += thread.still_ns - std::exchange(thread.counted_ns, thread.still_ns);
      continue;
    }
    thread.still_ns = 0;
    const TimeNs counted_ns = std::exchange(thread.counted_ns, 0);
    total_ns += std::max<TimeNs>(
        now.total_ns - before.total_ns - counted_ns - kOwnWaitNs * (now.count - before.count), 0);
  }
  if (++calls_count_ % kCallsPerLook == 0) Look();
  TimeNs longest_ns = 0;
  for (const auto& [pid, total_ns] : waited_ns) longest_ns = std::max(longest_ns, total_ns);
  return longest_ns;
}

}  // namespace tiltproof::harness
