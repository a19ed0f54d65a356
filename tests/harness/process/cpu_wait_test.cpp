#include "harness/process/cpu_wait.h"

#include <gtest/gtest.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <fstream>
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

bool KernelCounts() {
  std::ifstream file("/proc/thread-self/schedstat");
  long long run_ns = 0, wait_ns = 0, count = 0;
  return file >> run_ns >> wait_ns >> count && count > 0;
}

constexpr TimeNs kLookNs = 50 * kNsPerMs;
constexpr int kLooksMax = 400;  // 20 s
// Lets others run until the next look.
void Pause() { poll(nullptr, 0, static_cast<int>(kLookNs / kNsPerMs)); }

// A thread of the lowest priority, beside one that takes its processor. Only a wait that is not over has the exact length of
// the time between two looks.
TEST(CpuWaitTest, AWaitThatIsNotOverCounts) {
  if (!KernelCounts()) GTEST_SKIP() << "this kernel does not tell";
  cpu_set_t all, one;
  ASSERT_EQ(sched_getaffinity(0, sizeof all, &all), 0);
  CPU_ZERO(&one);
  for (int cpu = 0; CPU_COUNT(&one) == 0; ++cpu)
    if (CPU_ISSET(cpu, &all)) CPU_SET(cpu, &one);
  std::atomic<bool> over = false;
  const pid_t child = fork();
  if (child == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    const sched_param none{};
    sched_setaffinity(0, sizeof one, &one);
    sched_setscheduler(0, SCHED_IDLE, &none);
    for (;;) {
    }
  }
  std::thread busy([&] {
    sched_setaffinity(0, sizeof one, &one);
    while (!over) {
    }
  });
  CpuWait wait(child);
  int looks = 0;
  while (wait.Take(kLookNs) != kLookNs && looks++ < kLooksMax) Pause();
  over = true;
  busy.join();
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  EXPECT_LT(looks, kLooksMax);
}

// Its counters stand still between two ticks of the kernel.
TEST(CpuWaitTest, AThreadThatRunsWaitsForNothing) {
  // Others may take its processor now and then.
  TimeNs least_ns = kNever;
  for (int attempt = 0; attempt < 50; ++attempt) {
    CpuWait wait(getpid());
    TimeNs waited_ns = 0;
    for (int i = 0; i < 20; ++i) waited_ns += wait.Take(kNsPerUs);
    least_ns = std::min(least_ns, waited_ns);
  }
  EXPECT_EQ(least_ns, 0);
}

TEST(CpuWaitTest, AProcessThatIsStoppedWaitsForNothing) {
  const pid_t child = fork();
  if (child == 0)
    for (;;) raise(SIGSTOP);
  ASSERT_EQ(waitpid(child, nullptr, WUNTRACED), child);
  CpuWait wait(child);
  // It may have left its processor since.
  wait.Take(kNsPerS);
  EXPECT_EQ(wait.Take(kNsPerS), 0);
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
}

// Two programs of a shell, on one processor.
TEST(CpuWaitTest, ProcessesThatAProgramHasStartedCount) {
  if (!KernelCounts()) GTEST_SKIP() << "this kernel does not tell";
  const pid_t shell = fork();
  if (shell == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    setpgid(0, 0);
    cpu_set_t one;
    CPU_ZERO(&one);
    CPU_SET(sched_getcpu(), &one);
    sched_setaffinity(0, sizeof one, &one);
    execl("/bin/sh", "sh", "-c", "while :; do :; done & while :; do :; done & wait", nullptr);
    _exit(1);
  }
  for (int looks = 0; DescendantsOf(shell).size() < 2 && looks < kLooksMax; ++looks) Pause();
  EXPECT_EQ(DescendantsOf(shell).size(), 2U);
  // The shell itself waits for nothing now.
  kill(shell, SIGSTOP);
  CpuWait wait(shell, CpuWait::Of::kFamily);
  TimeNs waited_ns = 0;
  for (int looks = 0; waited_ns < 10 * kNsPerMs && looks < kLooksMax; ++looks) {
    Pause();
    waited_ns = wait.Take(kLookNs);
  }
  EXPECT_GE(waited_ns, 10 * kNsPerMs);
  kill(-shell, SIGKILL);
  waitpid(shell, nullptr, 0);
}

TEST(CpuWaitTest, AProcessThatIsNotThereWaitsForNothing) {
  CpuWait wait(1 << 30);
  EXPECT_EQ(wait.Take(kNsPerS), 0);
}

}  // namespace
}  // namespace tiltproof::harness
