// Whose time it is: of processes that sleep, run, are stopped, and stop themselves. The one who looks has a clock of its
// own here.
#include "harness/process/own_time.h"

#include <gtest/gtest.h>
#include <sched.h>
#include <sys/time.h>
#include <sys/timerfd.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <csignal>
#include <functional>
#include <thread>
#include <utility>

namespace tiltproof::harness {
namespace {

using std::chrono::seconds;

// Killed and reaped at the end.
class Child {
 public:
  explicit Child(const std::function<void()>& work) : pid_(fork()) {
    if (pid_ != 0) return;
    work();
    _exit(0);
  }
  ~Child() {
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;
  pid_t pid() const { return pid_; }
  // Until it is stopped.
  void AwaitStop() const { waitid(P_PID, static_cast<id_t>(pid_), nullptr, WSTOPPED | WNOWAIT); }
  void Stop() const {
    kill(pid_, SIGSTOP);
    AwaitStop();
  }

 private:
  pid_t pid_;
};

void Sleep() {
  for (;;) pause();
}

// A process, looked at every 100 ms of a clock that stands still meanwhile.
struct Looks {
  explicit Looks(
      pid_t pid, std::function<TimeNs()> observer_delay = [] { return 0; })
      : own(pid, std::move(observer_delay)) {
    own.Look(now);
    Look();  // the baseline
  }
  TimeNs Look(OwnTime::SteadyClock::duration later = OwnTime::kLook) { return own.Look(now += later); }
  OwnTime own;
  OwnTime::SteadyClock::time_point now{std::chrono::hours(1)};
};

TEST(OwnTime, AProcessThatSleepsIsChargedWithAllOfIt) {
  const Child child(Sleep);
  // It sleeps by now, or soon.
  Looks looks(child.pid());
  while (looks.Look() == 0) std::this_thread::yield();
  const TimeNs before = looks.Look();
  for (int i = 0; i < 10; ++i) looks.Look();
  EXPECT_EQ(looks.own.Look(looks.now), before + kNsPerS);
  EXPECT_EQ(looks.own.excuse(), OwnTime::Excuse::kNone);
}

TEST(OwnTime, AProcessThatIsStoppedIsNotCharged) {
  const Child child(Sleep);
  child.Stop();
  Looks looks(child.pid());
  for (int i = 0; i < 250; ++i) EXPECT_EQ(looks.Look(), 0);
  EXPECT_EQ(looks.own.excuse(), OwnTime::Excuse::kStopped);
  EXPECT_EQ(looks.own.stopped_pid(), child.pid());
  EXPECT_FALSE(looks.own.stopped_itself());
}

TEST(OwnTime, AProcessThatWaitsForAStoppedOneIsNotCharged) {
  std::array<int, 2> ends{};
  ASSERT_EQ(pipe(ends.data()), 0);
  const Child child([&] {
    const Child grandchild(Sleep);
    grandchild.Stop();
    [[maybe_unused]] const ssize_t written = write(ends[1], "", 1);
    Sleep();
  });
  char byte;
  ASSERT_EQ(read(ends[0], &byte, 1), 1);
  Looks looks(child.pid());
  for (int i = 0; i < 20; ++i) EXPECT_EQ(looks.Look(), 0);
  kill(looks.own.stopped_pid(), SIGKILL);
}

TEST(OwnTime, AProcessThatStopsItselfIsCharged) {
  const Child child([] { raise(SIGSTOP); });
  child.AwaitStop();
  EXPECT_TRUE(HasStoppedItself(child.pid()));
  Looks looks(child.pid());
  for (int i = 1; i <= 20; ++i) EXPECT_EQ(looks.Look(), i * 100 * kNsPerMs);
  EXPECT_TRUE(looks.own.stopped_itself());
}

TEST(OwnTime, TimeInWhichTheOneWhoLooksWasStoppedIsNotCharged) {
  const Child child(Sleep);
  Looks looks(child.pid());
  while (looks.Look() == 0) std::this_thread::yield();
  const TimeNs before = looks.Look();
  EXPECT_LE(looks.Look(seconds(25)) - before, 200 * kNsPerMs);
}

TEST(OwnTime, TimeInWhichTheOneWhoLooksHadNoProcessorIsNotCharged) {
  const Child child(Sleep);
  TimeNs delay_ns = 0;
  Looks looks(child.pid(), [&] { return delay_ns; });
  while (looks.Look() == 0) std::this_thread::yield();
  delay_ns = 60 * kNsPerMs;
  const TimeNs before = looks.Look();
  EXPECT_EQ(looks.Look() - before, 40 * kNsPerMs);
  delay_ns = 500 * kNsPerMs;
  EXPECT_EQ(looks.Look() - before, (40 + 10) * kNsPerMs);
}

// A thread of the lowest priority, and other processes that take its processor.
TEST(OwnTime, KnowsHowLongAThreadHadNoProcessor) {
  cpu_set_t one;
  CPU_ZERO(&one);
  CPU_SET(sched_getcpu(), &one);
  const auto run = [&](bool idle) {
    sched_setaffinity(0, sizeof one, &one);
    const sched_param none{};
    if (idle) sched_setscheduler(0, SCHED_IDLE, &none);
  };
  const auto forever = [&] {
    run(false);
    for (volatile bool on = true; on;) {
    }
  };
  const Child other(forever);
  std::atomic<bool> over = false;
  std::thread starved([&] {
    run(true);
    while (!over) {
    }
  });
  // A wait is known when it is over, with all of it. The first that is known was not over at the look before, so those that
  // are counted begin after that look. This thread may lose its processor between any two lines.
  OwnTime::OwnDelay delay;
  auto before = OwnTime::SteadyClock::now(), began = before;
  delay();
  do {
    began = before;
    before = OwnTime::SteadyClock::now();
  } while (delay() == 0);
  // However long it takes.
  for (TimeNs sum_ns = 0; sum_ns < 50 * kNsPerMs; sum_ns += delay()) std::this_thread::yield();
  // This thread waits at the same time as the other, and each wait is counted when it is over.
  EXPECT_GE(2 * (OwnTime::SteadyClock::now() - began), std::chrono::milliseconds(40));
  over = true;
  starved.join();
}

// By this clock it had no processor for most of the time.
TEST(OwnTime, AProcessThatRunsIsChargedWithWhatItRan) {
  const Child child([] {
    for (volatile bool forever = true; forever;) {
    }
  });
  Looks looks(child.pid());
  TimeNs own_ns = 0;
  for (int i = 0; i < 100; ++i) own_ns = looks.Look();
  EXPECT_LT(own_ns, 5 * kNsPerS);
  EXPECT_EQ(looks.own.excuse(), OwnTime::Excuse::kNoProcessor);
}

TEST(ProcessorTime, IsThatOfAProcessThatComputes) {
  const Child busy([] {
    for (volatile bool forever = true; forever;) {
    }
  });
  const Child idle(Sleep);
  while (ProcessorTime(busy.pid()) < 50 * kNsPerMs) std::this_thread::yield();
  EXPECT_LT(ProcessorTime(idle.pid()), 50 * kNsPerMs);
  busy.Stop();
  const TimeNs stopped = ProcessorTime(busy.pid());
  EXPECT_EQ(ProcessorTime(busy.pid()), stopped);
  constexpr pid_t kBeyondAll = 1 << 22;  // proc(5), pid_max
  EXPECT_EQ(ProcessorTime(kBeyondAll), 0);
}

TEST(AwaitInput, SeesWhatComesAndWhoIsSilent) {
  std::array<int, 2> ends{};
  ASSERT_EQ(pipe(ends.data()), 0);
  const Child child(Sleep);
  EXPECT_EQ(AwaitInput(ends[0], child.pid(), 100 * kNsPerMs), Input::kSilent);
  ASSERT_EQ(write(ends[1], "", 1), 1);
  EXPECT_EQ(AwaitInput(ends[0], child.pid(), 0), Input::kReady);
}

// For longer than the limit.
TEST(AwaitInput, ASignalEndsTheWaitWhereAsked) {
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);
  struct sigaction action {
  }, before{};
  action.sa_handler = [](int) {};
  sigaction(SIGALRM, &action, &before);
  const itimerval often{{0, 10'000}, {0, 10'000}};
  setitimer(ITIMER_REAL, &often, nullptr);
  EXPECT_EQ(AwaitInput(ends[0], -1, 600 * kNsPerS, OnSignal::kReturn), Input::kInterrupted);
  EXPECT_EQ(AwaitInput(ends[0], -1, 100 * kNsPerMs), Input::kSilent);
  const itimerval never{};
  setitimer(ITIMER_REAL, &never, nullptr);
  sigaction(SIGALRM, &before, nullptr);
  for (const int end : ends) close(end);
}

TEST(AwaitInput, WaitsForAStoppedProcess) {
  const Child child(Sleep);
  child.Stop();
  const int timer = timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC);
  const itimerspec once{{}, {0, 900'000'000}};
  ASSERT_EQ(timerfd_settime(timer, 0, &once, nullptr), 0);
  EXPECT_EQ(AwaitInput(timer, child.pid(), 300 * kNsPerMs), Input::kReady);
  close(timer);
}

// A process that ends between the opening and the reading of its files is none that is stopped.
TEST(OwnTimeTest, AProcessMayEndWhileItIsLookedAt) {
  for (int i = 0; i < 300; ++i) {
    const pid_t child = fork();
    ASSERT_NE(child, -1);
    if (child == 0) _exit(0);
    std::atomic<bool> reaped = false;
    std::thread reaper([&] {
      waitpid(child, nullptr, 0);
      reaped = true;
    });
    while (!reaped) ASSERT_NO_THROW(IsStopped(child));
    reaper.join();
  }
}

}  // namespace
}  // namespace tiltproof::harness
