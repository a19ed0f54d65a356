#include "harness/process/affinity.h"

#include <charconv>
#include <filesystem>
#include <string>
#include <system_error>

namespace tiltproof::harness {

void AllowProcessors(pid_t pid, const cpu_set_t& processors) {
  std::error_code error;
  const std::filesystem::path tasks = std::filesystem::path("/proc") / std::to_string(pid) / "task";
  for (std::filesystem::directory_iterator task(tasks, error);
       !error && task != std::filesystem::directory_iterator(); task.increment(error)) {
    const std::string name = task->path().filename();
    pid_t thread = 0;
    if (std::from_chars(name.data(), name.data() + name.size(), thread).ec == std::errc())
      sched_setaffinity(thread, sizeof processors, &processors);
  }
}

}  // namespace tiltproof::harness
