#include "harness/process/cpu_wait.h"

#include <gtest/gtest.h>
#include <sched.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <thread>

#include "harness/process/descendants_time.h"

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
  EXPECT_GT(wait.Take(0), kWork / 3);
  done = true;
  first.join();
  second.join();
  EXPECT_EQ(sched_setaffinity(0, sizeof all, &all), 0);
}

// A thread of the lowest priority, beside one that takes its processor.
TEST(CpuWaitTest, AWaitThatIsNotOverCounts) {
  if (!std::filesystem::exists("/proc/self/schedstat")) GTEST_SKIP() << "this kernel does not tell";
  cpu_set_t all, one;
  ASSERT_EQ(sched_getaffinity(0, sizeof all, &all), 0);
  CPU_ZERO(&one);
  for (int cpu = 0; CPU_COUNT(&one) == 0; ++cpu)
    if (CPU_ISSET(cpu, &all)) CPU_SET(cpu, &one);
  std::atomic<bool> over = false;
  const auto work = [&](int policy) {
    const sched_param none{};
    sched_setaffinity(0, sizeof one, &one);
    sched_setscheduler(0, policy, &none);
    while (!over) {
    }
  };
  std::thread busy(work, SCHED_OTHER), starved(work, SCHED_IDLE);
  CpuWait wait(getpid());
  // Between two looks it did not run at all: one of the threads was ready all the time.
  while (wait.Take(kNsPerS) < kNsPerS) std::this_thread::yield();
  over = true;
  busy.join();
  starved.join();
}

// Its counters stand still between two ticks of the kernel.
TEST(CpuWaitTest, AThreadThatRunsWaitsForNothing) {
  CpuWait wait(getpid());
  TimeNs waited_ns = 0;
  for (int i = 0; i < 1000; ++i) waited_ns += wait.Take(kNsPerUs);
  EXPECT_LT(waited_ns, kNsPerUs);
}

TEST(CpuWaitTest, AProcessThatIsStoppedWaitsForNothing) {
  const pid_t child = fork();
  if (child == 0)
    for (;;) raise(SIGSTOP);
  ASSERT_EQ(waitpid(child, nullptr, WUNTRACED), child);
  CpuWait wait(child);
  EXPECT_EQ(wait.Take(kNsPerS), 0);
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
}

// A shell and the program that it has started, on one processor.
TEST(CpuWaitTest, ProcessesThatAProgramHasStartedCount) {
  if (!std::filesystem::exists("/proc/self/schedstat")) GTEST_SKIP() << "this kernel does not tell";
  const pid_t shell = fork();
  if (shell == 0) {
    cpu_set_t one;
    CPU_ZERO(&one);
    CPU_SET(sched_getcpu(), &one);
    sched_setaffinity(0, sizeof one, &one);
    execl("/bin/sh", "sh", "-c", "while :; do :; done & while :; do :; done & wait", nullptr);
    _exit(1);
  }
  while (DescendantsOf(shell).size() < 2) std::this_thread::yield();
  // The shell itself waits for nothing now.
  kill(shell, SIGSTOP);
  ASSERT_EQ(waitpid(shell, nullptr, WUNTRACED), shell);
  CpuWait wait(shell);
  for (TimeNs waited_ns = 0; waited_ns < kNsPerS;) waited_ns += wait.Take(kNsPerS);
  for (const pid_t child : DescendantsOf(shell)) kill(child, SIGKILL);
  kill(shell, SIGKILL);
  waitpid(shell, nullptr, 0);
}

TEST(CpuWaitTest, AProcessThatIsNotThereWaitsForNothing) {
  CpuWait wait(1 << 30);
  EXPECT_EQ(wait.Take(kNsPerS), 0);
}

}  // namespace
}  // namespace tiltproof::harness
