#include "harness/process/cpu_wait.h"

#include <gtest/gtest.h>
#include <sched.h>
#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <thread>

namespace tiltproof::harness {
namespace {

// Computes until this thread has had so much processor time.
void Compute(TimeNs cpu_ns) {
  timespec now{};
  do clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  while (now.tv_sec * kNsPerS + now.tv_nsec < cpu_ns);
}

TEST(CpuWaitTest, ThreadsThatShareAProcessorWaitForEachOther) {
  if (!std::filesystem::exists("/proc/self/schedstat")) GTEST_SKIP() << "this kernel does not tell";
  cpu_set_t all, one;
  ASSERT_EQ(sched_getaffinity(0, sizeof all, &all), 0);
  CPU_ZERO(&one);
  for (int cpu = 0; CPU_COUNT(&one) == 0; ++cpu)
    if (CPU_ISSET(cpu, &all)) CPU_SET(cpu, &one);
  // Threads inherit it.
  ASSERT_EQ(sched_setaffinity(0, sizeof one, &one), 0);
  constexpr TimeNs kWork = 60 * kNsPerMs;
  std::atomic<bool> go = false, done = false;
  std::atomic<int> ended = 0;
  const auto work = [&] {
    while (!go) std::this_thread::yield();
    Compute(kWork);
    ++ended;
    while (!done) sched_yield();
  };
  std::thread first(work), second(work);
  CpuWait wait(getpid());
  go = true;
  while (ended < 2) std::this_thread::yield();
  // While one of the two computed, the other waited: what is left out is the wait that is not over.
  EXPECT_GT(wait.Take(), kWork / 3);
  done = true;
  first.join();
  second.join();
  EXPECT_EQ(sched_setaffinity(0, sizeof all, &all), 0);
}

TEST(CpuWaitTest, AProcessThatIsNotThereWaitsForNothing) {
  CpuWait wait(1 << 30);
  EXPECT_EQ(wait.Take(), 0);
}

}  // namespace
}  // namespace tiltproof::harness
