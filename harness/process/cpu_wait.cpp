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

namespace tiltproof::harness {
// Three numbers: nanoseconds run, nanoseconds spent waiting to run, how often it has run
// (Documentation/scheduler/sched-stats.rst of Linux).
CpuWait::Waits CpuWait::Read(int descriptor) {
  std::array<char, 128> text;
  const ssize_t size = pread(descriptor, text.data(), text.size() - 1, 0);
  Waits waits;
  if (size <= 0) return waits;
  text[static_cast<std::size_t>(size)] = '\0';
  char* rest = text.data();
  std::strtoll(rest, &rest, 10);
  waits.total_ns = std::strtoll(rest, &rest, 10);
  waits.count = std::strtoll(rest, &rest, 10);
  return waits;
}

CpuWait::CpuWait(pid_t pid) : pid_(pid) { Look(); }

void CpuWait::Look() {
  std::error_code error;
  const std::filesystem::path tasks = std::filesystem::path("/proc") / std::to_string(pid_) / "task";
  for (std::filesystem::directory_iterator task(tasks, error);
       !error && task != std::filesystem::directory_iterator(); task.increment(error)) {
    const std::string id = task->path().filename();
    if (threads_.contains(id)) continue;
    link::OwnedDescriptor file(open((task->path() / "schedstat").c_str(), O_RDONLY | O_CLOEXEC));
    if (file.get() < 0) continue;
    const Waits seen = Read(file.get());
    threads_.emplace(id, Thread{std::move(file), seen});
  }
}

TimeNs CpuWait::Take() {
  TimeNs total_ns = 0;
  for (auto it = threads_.begin(); it != threads_.end();) {
    Thread& thread = it->second;
    const Waits now = Read(thread.file.get());
    const Waits before = std::exchange(thread.seen, now);
    if (now.count < before.count) {  // it has ended
      it = threads_.erase(it);
      continue;
    }
    total_ns += std::max<TimeNs>(now.total_ns - before.total_ns - kOwnWaitNs * (now.count - before.count), 0);
    ++it;
  }
  if (++calls_count_ % kCallsPerLook == 0) Look();
  return total_ns;
}

}  // namespace tiltproof::harness
