#include "harness/process/affinity.h"

#include <gtest/gtest.h>
#include <sched.h>
#include <unistd.h>

namespace tiltproof::harness {
namespace {

TEST(OwnProcessors, AreThoseThatThisProcessMayUse) {
  const std::string all = OwnProcessors();
  EXPECT_FALSE(all.empty());
  EXPECT_EQ(OwnProcessors(), all);
  cpu_set_t allowed, one;
  ASSERT_EQ(sched_getaffinity(0, sizeof allowed, &allowed), 0);
  if (CPU_COUNT(&allowed) < 2) GTEST_SKIP() << "there is one processor";
  int first = 0;
  while (!CPU_ISSET(first, &allowed)) ++first;
  CPU_ZERO(&one);
  CPU_SET(first, &one);
  AllowProcessors(getpid(), one);
  EXPECT_NE(OwnProcessors(), all);
  AllowProcessors(getpid(), allowed);
  EXPECT_EQ(OwnProcessors(), all);
}

}  // namespace
}  // namespace tiltproof::harness
