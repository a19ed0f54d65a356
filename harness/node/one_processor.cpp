#include "harness/node/one_processor.h"

#include <time.h>

#include <filesystem>
#include <string>
#include <system_error>

namespace tiltproof::harness {
namespace {

// A program that has run for more than nine tenths of this time does not sleep. The first moments, in which
// the emulator translates the firmware, are shorter.
constexpr std::chrono::milliseconds kSpan{500};

}  // namespace

OneProcessor::OneProcessor(pid_t pid) : pid_(pid) {
  if (sched_getaffinity(0, sizeof all_, &all_) != 0 || CPU_COUNT(&all_) < 2) return;
  int left = static_cast<int>(pid) % CPU_COUNT(&all_);
  cpu_set_t one;
  CPU_ZERO(&one);
  for (int i = 0; CPU_COUNT(&one) == 0; ++i)
    if (CPU_ISSET(i, &all_) && left-- == 0) CPU_SET(i, &one);
  Allow(one);
  watched_ = true;
  since_ = Clock::now();
  run_ = TimeRun();
}

void OneProcessor::Watch() {
  const auto now = Clock::now();
  if (!watched_ || now - since_ < kSpan) return;
  const auto run = TimeRun();
  if (10 * (run - run_) > 9 * (now - since_)) {
    Allow(all_);
    watched_ = false;
  }
  since_ = now;
  run_ = run;
}

void OneProcessor::Allow(const cpu_set_t& processors) const {
  std::error_code error;
  const std::filesystem::path tasks = std::filesystem::path("/proc") / std::to_string(pid_) / "task";
  for (std::filesystem::directory_iterator task(tasks, error);
       !error && task != std::filesystem::directory_iterator(); task.increment(error))
    sched_setaffinity(std::stoi(task->path().filename()), sizeof processors, &processors);
}

std::chrono::nanoseconds OneProcessor::TimeRun() const {
  clockid_t clock{};
  timespec time{};
  if (clock_getcpuclockid(pid_, &clock) != 0 || clock_gettime(clock, &time) != 0) return {};
  return std::chrono::seconds(time.tv_sec) + std::chrono::nanoseconds(time.tv_nsec);
}

}  // namespace tiltproof::harness
