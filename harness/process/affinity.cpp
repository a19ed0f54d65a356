#include "harness/process/affinity.h"

#include <charconv>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
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

std::string OwnProcessors() {
  std::string boot, line;
  std::ifstream("/proc/sys/kernel/random/boot_id") >> boot;
  std::ifstream status("/proc/self/status");
  constexpr std::string_view kAllowed = "Cpus_allowed_list:\t";
  while (std::getline(status, line))
    if (line.starts_with(kAllowed) && !boot.empty()) return boot + ' ' + line.substr(kAllowed.size());
  return "";
}

}  // namespace tiltproof::harness
