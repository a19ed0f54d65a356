// Two processes that take turns run on one processor, and are let go afterwards.
#include "harness/process/shared_processor.h"

#include <gtest/gtest.h>
#include <sched.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

namespace tiltproof::harness {
namespace {

cpu_set_t AllowedTo(pid_t pid) {
  cpu_set_t set;
  CPU_ZERO(&set);
  sched_getaffinity(pid, sizeof(set), &set);
  return set;
}

TEST(SharedProcessorTest, BothStayOnOneUntilTheEnd) {
  const cpu_set_t before = AllowedTo(0);
  if (CPU_COUNT(&before) < 2) GTEST_SKIP() << "this machine gives one processor only";
  const pid_t child = fork();
  if (child == 0)
    for (;;) pause();
  {
    SharedProcessor together(child);
    for (int turn = 0; turn < 5000; ++turn) {
      together.BeginTurn();
      together.EndTurn();
      const cpu_set_t own = AllowedTo(0), other = AllowedTo(child);
      ASSERT_EQ(CPU_COUNT(&own), 1);
      ASSERT_TRUE(CPU_EQUAL(&own, &other));
      ASSERT_TRUE(CPU_ISSET(sched_getcpu(), &own));
    }
  }
  const cpu_set_t after = AllowedTo(0);
  EXPECT_TRUE(CPU_EQUAL(&before, &after));
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
}

}  // namespace
}  // namespace tiltproof::harness
