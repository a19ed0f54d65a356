#include "harness/process/hang_watch.h"

#include <gtest/gtest.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>

namespace tiltproof::harness {
namespace {

using std::chrono::milliseconds;

// A process that does nothing but compute, or nothing at all.
class Child {
 public:
  explicit Child(bool busy) : pid_(fork()) {
    if (pid_ != 0) return;
    for (;;)
      if (!busy) pause();
  }
  ~Child() {
    Signal(SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
  void Signal(int number) const { kill(pid_, number); }
  pid_t pid() const { return pid_; }

 private:
  pid_t pid_;
};

// As a board is looked at.
void Look(HangWatch& watch, milliseconds time, const HangWatch::Sent& sent = {}, bool held = false) {
  for (const auto end = HangWatch::Clock::now() + time; HangWatch::Clock::now() < end;) {
    watch.Look(HangWatch::Clock::now(), sent, held);
    poll(nullptr, 0, 51);
  }
}

// Looks until it has been silent for so long of its own time: on a busy machine later.
void LookUntilSilent(HangWatch& watch, TimeNs silent_ns) {
  const auto end = HangWatch::Clock::now() + std::chrono::seconds(20);
  while (watch.silent_ns() < silent_ns && HangWatch::Clock::now() < end) Look(watch, milliseconds(51));
}

TEST(HangWatchTest, OneThatComputesIsBusyAndOneThatSleepsIsSilentAlone) {
  const Child busy(true), asleep(false);
  HangWatch busy_watch(busy.pid()), asleep_watch(asleep.pid());
  LookUntilSilent(busy_watch, kNsPerS);
  EXPECT_GE(busy_watch.silent_ns(), kNsPerS);
  EXPECT_GT(busy_watch.busy_ns(), kNsPerS / 2);
  LookUntilSilent(asleep_watch, kNsPerS);
  EXPECT_GE(asleep_watch.silent_ns(), kNsPerS);
  EXPECT_LT(asleep_watch.busy_ns(), kNsPerS / 2);
}

TEST(HangWatchTest, ABytePutsItBackAndAFaultHoldsItThere) {
  const Child busy(true);
  HangWatch watch(busy.pid());
  LookUntilSilent(watch, kNsPerS / 2);
  const auto now = HangWatch::Clock::now();
  watch.Look(now, {.any = now, .main_line = {}}, false);
  EXPECT_EQ(watch.busy_ns(), 0);
  EXPECT_EQ(watch.active(), now);
  EXPECT_GE(watch.silent_ns(), kNsPerS / 2) << "another line's byte";
  watch.Look(now, {.any = now, .main_line = now}, false);
  EXPECT_EQ(watch.silent_ns(), 0);
  EXPECT_EQ(watch.spoke(), now);
  Look(watch, milliseconds(400), {.any = now, .main_line = now}, true);
  EXPECT_EQ(watch.silent_ns(), 0);
  EXPECT_EQ(watch.busy_ns(), 0);
}

TEST(HangWatchTest, TimeInWhichItIsStoppedDoesNotCount) {
  const Child busy(true);
  HangWatch watch(busy.pid());
  LookUntilSilent(watch, kNsPerS / 5);
  busy.Signal(SIGSTOP);
  Look(watch, milliseconds(200));
  const TimeNs before_ns = watch.silent_ns();
  Look(watch, milliseconds(600));
  EXPECT_EQ(watch.silent_ns(), before_ns);
}

}  // namespace
}  // namespace tiltproof::harness
