// Lateness that a firmware's own processes explain, and the known part of their processor time.
#include "harness/run/firmware_use.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <ctime>
#include <string>
#include <string_view>

#include "harness/process/descendants_time.h"

namespace tiltproof::harness {
namespace {

constexpr TimeNs kMs = kNsPerMs;

constexpr std::string_view kProcessors = "a boot 0-1";

BootTime At(TimeNs ms) { return BootTime(ms * kMs); }

FirmwareUse With(std::int64_t processors_count, double share, TimeNs begin_ms, TimeNs end_ms) {
  FirmwareUse use{.processors = std::string(kProcessors), .processors_count = processors_count, .spans = {}};
  for (TimeNs ms = begin_ms; ms < end_ms; ms += 100) {
    const auto run_ns = static_cast<TimeNs>(share * static_cast<double>(processors_count * 100 * kMs));
    use.Add({At(ms), At(ms + 100), run_ns, 9});
  }
  return use;
}

TEST(FirmwareUse, KeepsWhatLeavesLessThanHalfAProcessor) {
  EXPECT_EQ(With(2, 0.74, 0, 1000).spans.size(), 0u);
  EXPECT_EQ(With(2, 0.75, 0, 1000).spans.size(), 10u);
  EXPECT_EQ(With(2, 0.5, 0, 1000).spans.size(), 0u);   // its right: one of two
  EXPECT_EQ(With(8, 0.93, 0, 1000).spans.size(), 0u);  // another program has half a processor, and more
  EXPECT_EQ(With(8, 0.94, 0, 1000).spans.size(), 10u);
  EXPECT_EQ(With(1, 1.0, 0, 1000).spans.size(), 0u);  // its right: the only one
}

TEST(OwnLateness, ExplainsWhatIsWithinABurst) {
  const OwnLateness own(With(2, 0.95, 1000, 2000), Origin(At(500)));
  const auto explains = [&](TimeNs begin_ms, TimeNs end_ms) {
    return own.Explains({begin_ms * kMs, end_ms * kMs}, kProcessors);
  };
  EXPECT_TRUE(explains(600, 900));
  EXPECT_TRUE(explains(300, 1700));  // with its edges
  EXPECT_FALSE(explains(299, 900));
  EXPECT_FALSE(explains(900, 1701));
  EXPECT_FALSE(explains(0, 100));
  EXPECT_EQ(own.total(), (ProcessorUse{1900 * kMs, 1000 * kMs, 2, 9}));
}

// A flight that never started: times count to its end.
TEST(OwnLateness, ExplainsTheTimeBeforeAStartThatNeverCame) {
  const OwnLateness own(With(2, 0.95, 1000, 9000), Origin(At(10000)));
  EXPECT_TRUE(own.Explains({-8000 * kMs, -1000 * kMs}, kProcessors));
  EXPECT_FALSE(own.Explains({-800 * kMs, -100 * kMs}, kProcessors));
}

// On another machine, or on others of its processors, something else is the cause.
TEST(OwnLateness, ExplainsNoLatenessOnOtherProcessors) {
  FirmwareUse use = With(2, 0.95, 1000, 2000);
  const LateSpan late{700 * kMs, 704 * kMs};
  EXPECT_TRUE(OwnLateness(use, Origin(At(500))).Explains(late, kProcessors));
  EXPECT_FALSE(OwnLateness(use, Origin(At(500))).Explains(late, "a boot 2-3"));
  EXPECT_FALSE(OwnLateness(use, Origin(At(500))).Explains(late, "another boot 0-1"));
  use.processors = "";  // unknown, like that of the node
  EXPECT_FALSE(OwnLateness(use, Origin(At(500))).Explains(late, ""));
}

TEST(OwnLateness, ExplainsNothingWhenTheStartIsUnknown) {
  const OwnLateness own(With(2, 0.95, 0, 1000), Origin());
  EXPECT_FALSE(own.Explains({0, kMs}, kProcessors));
  EXPECT_FALSE(own.total().has_value());
}

TEST(DescendantsTime, CountsChildrenThatLiveAndThoseThatHaveEnded) {
  const DescendantsTime before = LookAtDescendants();
  const auto burn = [](TimeNs until_ns) {
    for (timespec now{}; now.tv_sec * kNsPerS + now.tv_nsec < until_ns;)
      clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  };
  int ready[2];
  ASSERT_EQ(pipe(ready), 0);
  const pid_t child = fork();
  if (child == 0) {
    const pid_t grandchild = fork();
    burn(200 * kMs);
    if (grandchild == 0) _exit(0);
    waitpid(grandchild, nullptr, 0);
    if (write(ready[1], "", 1) != 1) _exit(1);
    pause();
    _exit(0);
  }
  char byte = 0;
  ASSERT_EQ(read(ready[0], &byte, 1), 1);
  // The child has waited for the grandchild, whose time is known in ticks of 10 ms.
  const DescendantsTime alive = LookAtDescendants();
  EXPECT_GE(alive.run_min_ns - before.run_max_ns, 380 * kMs);
  EXPECT_EQ(alive.processes_count - before.processes_count, 1);
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  const DescendantsTime ended = LookAtDescendants();
  EXPECT_GE(ended.run_min_ns - before.run_max_ns, 380 * kMs);
  EXPECT_LT(ended.run_max_ns - before.run_min_ns, 2000 * kMs);
  EXPECT_EQ(ended.processes_count, before.processes_count);
  close(ready[0]);
  close(ready[1]);
}

}  // namespace
}  // namespace tiltproof::harness
