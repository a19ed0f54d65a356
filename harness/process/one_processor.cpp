#include "harness/process/one_processor.h"

#include <time.h>

#include "harness/process/affinity.h"

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
  AllowProcessors(pid_, one);
  watched_ = true;
  since_ = Clock::now();
  run_ = TimeRun();
}

void OneProcessor::Watch() {
  const auto now = Clock::now();
  if (!watched_ || now - since_ < kSpan) return;
  const auto run = TimeRun();
  if (10 * (run - run_) > 9 * (now - since_)) {
    AllowProcessors(pid_, all_);
    watched_ = false;
  }
  since_ = now;
  run_ = run;
}

std::chrono::nanoseconds OneProcessor::TimeRun() const {
  clockid_t clock{};
  timespec time{};
  if (clock_getcpuclockid(pid_, &clock) != 0 || clock_gettime(clock, &time) != 0) return {};
  return std::chrono::seconds(time.tv_sec) + std::chrono::nanoseconds(time.tv_nsec);
}

}  // namespace tiltproof::harness
