// Crashes, ends and hangs of the firmware become exceptions, again and again, and the harness's own crash stays a crash.

#include "harness/client/firmware_guard.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pthread.h>
#include <sys/timerfd.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cfenv>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <ctime>
#include <functional>
#include <stdexcept>

namespace tiltproof::harness {
namespace {

using ::testing::HasSubstr;

constexpr TimeNs kShortLimit = 300 * kNsPerMs;

// The guard's message about a firmware that does this when it is granted time; empty if there is none.
std::string TroubleOf(const std::function<void()>& firmware, bool hung = false) {
  try {
    FirmwareGuard::Call(FirmwareCall::kGrant, firmware);
  } catch (const FirmwareTrouble& trouble) {
    EXPECT_EQ(trouble.hung, hung);
    return trouble.what();
  }
  return {};
}

void Loop() {
  for (volatile bool forever = true; forever;) {
  }
}

TEST(FirmwareGuard, ReturnsWhatTheCallReturns) {
  FirmwareGuard::Install();
  EXPECT_EQ(FirmwareGuard::Call(FirmwareCall::kGrant, [] { return 42; }), 42);
}

TEST(FirmwareGuard, TurnsEverySignalIntoTroubleMoreThanOnce) {
  FirmwareGuard::Install();
  for (int round = 0; round < 2; ++round)
    for (const int signal_number : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGTRAP, SIGSYS})
      EXPECT_THAT(TroubleOf([&] { raise(signal_number); }), HasSubstr("crashed in tiltproof_client_grant"));
}

TEST(FirmwareGuard, TurnsEveryEndOfTheProcessIntoTrouble) {
  FirmwareGuard::Install();
  EXPECT_THAT(TroubleOf([] { std::exit(3); }), HasSubstr("called exit(3) in tiltproof_client_grant"));
  EXPECT_THAT(TroubleOf([] { _exit(4); }), HasSubstr("called _exit(4)"));
  EXPECT_THAT(TroubleOf([] { std::_Exit(5); }), HasSubstr("called _Exit(5)"));
  EXPECT_THAT(TroubleOf([] { std::quick_exit(6); }), HasSubstr("called quick_exit(6)"));
  EXPECT_THAT(TroubleOf([] { pthread_exit(nullptr); }), HasSubstr("called pthread_exit"));
  EXPECT_THAT(TroubleOf([] { execl("/bin/true", "true", nullptr); }), HasSubstr("called exec (/bin/true)"));
  EXPECT_THAT(TroubleOf([] { execle("/bin/true", "true", nullptr, environ); }), HasSubstr("called exec"));
  EXPECT_THAT(TroubleOf([] { execlp("true", "true", nullptr); }), HasSubstr("called exec (true)"));
}

// Processes that a firmware starts are its own business. In them, the guarded functions work as usual.
TEST(FirmwareGuard, LeavesProcessesThatTheFirmwareStartsAlone) {
  FirmwareGuard::Install();
  int status = -1;
  EXPECT_EQ(TroubleOf([&] {
              const pid_t pid = fork();
              if (pid == 0) execlp("sh", "sh", "-c", "exit $0", "7", nullptr);
              while (waitpid(pid, &status, 0) < 0 && errno == EINTR) {
              }
            }),
            "");
  EXPECT_EQ(WEXITSTATUS(status), 7);
}

TEST(FirmwareGuard, TurnsExceptionsIntoTrouble) {
  FirmwareGuard::Install();
  EXPECT_THAT(TroubleOf([] { throw std::out_of_range("too far"); }),
              HasSubstr("threw an exception: too far"));
  EXPECT_THAT(TroubleOf([] { throw 7; }), HasSubstr("threw an exception"));
}

TEST(FirmwareGuard, AnExceptionOfTheHarnessStaysTheHarnesss) {
  FirmwareGuard::Install();
  bool came_back = false;
  EXPECT_THROW(
      FirmwareGuard::Call(FirmwareCall::kGrant,
                          [&] {
                            FirmwareGuard::CallBack([]() -> int { throw std::length_error("ours"); });
                            came_back = true;
                          }),
      std::length_error);
  EXPECT_FALSE(came_back);
}

TEST(FirmwareGuard, SurvivesAnExhaustedStack) {
  FirmwareGuard::Install();
  struct Recursion {
    static int Deeper(volatile char* above) {
      volatile char here[4096];
      here[0] = above[0];
      return here[0] == 0 ? 0 : Deeper(here) + here[0];
    }
  };
  volatile char start[1] = {1};
  EXPECT_THAT(TroubleOf([&] { Recursion::Deeper(start); }), HasSubstr("crashed"));
}

TEST(FirmwareGuard, EndsACallThatNeverReturns) {
  FirmwareGuard::Install(nullptr, kShortLimit);
  EXPECT_THAT(TroubleOf(Loop, true), HasSubstr("did not return from tiltproof_client_grant within 0.3 s"));
  EXPECT_THAT(TroubleOf(
                  [] {
                    for (;;) pause();
                  },
                  true),
              HasSubstr("did not return"));
}

TEST(FirmwareGuard, EndsACallThatCallsBackWithoutEnd) {
  FirmwareGuard::Install(nullptr, kShortLimit);
  EXPECT_THAT(TroubleOf(
                  [] {
                    for (;;) FirmwareGuard::CallBack([] { return 0; });
                  },
                  true),
              HasSubstr("did not return"));
}

// In the harness: for another process, which may be stopped.
TEST(FirmwareGuard, WaitingForTheHarnessIsNotTheFirmwares) {
  FirmwareGuard::Install(nullptr, kShortLimit);
  EXPECT_EQ(TroubleOf([] {
              FirmwareGuard::CallBack([] {
                const int timer = timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC);
                const itimerspec once{{}, {0, 900'000'000}};
                timerfd_settime(timer, 0, &once, nullptr);
                std::uint64_t expirations = 0;
                [[maybe_unused]] const ssize_t got = read(timer, &expirations, sizeof expirations);
                return close(timer);
              });
            }),
            "");
}

TEST(FirmwareGuard, IsToldFromOutsideThatTheFirmwareHasStoppedItself) {
  FirmwareGuard::Watched watched;
  FirmwareGuard::Install(&watched);
  EXPECT_THAT(TroubleOf(
                  [&] {
                    EXPECT_EQ(watched.inside, FirmwareCall::kGrant);
                    watched.stopped_itself = true;
                    for (;;) pause();
                  },
                  true),
              HasSubstr("stopped itself in tiltproof_client_grant"));
  EXPECT_EQ(watched.inside, FirmwareCall::kNone);
  FirmwareGuard::Install();
}

TEST(FirmwareGuard, FloatingPointModesAreTheHarnesssAfterEveryCall) {
  FirmwareGuard::Install();
  const auto ours = [] { return std::fegetround() == FE_TONEAREST; };
  const auto change = [] { std::fesetround(FE_UPWARD); };
  FirmwareGuard::Call(FirmwareCall::kGrant, change);
  EXPECT_TRUE(ours());
  TroubleOf([&] {
    change();
    raise(SIGSEGV);
  });
  EXPECT_TRUE(ours());
  TroubleOf([&] {
    change();
    throw 7;
  });
  EXPECT_TRUE(ours());
  bool in_call_back = false, after = true;
  FirmwareGuard::Call(FirmwareCall::kGrant, [&] {
    change();
    in_call_back = FirmwareGuard::CallBack(ours);
    after = ours();
  });
  EXPECT_TRUE(in_call_back);
  EXPECT_FALSE(after) << "the firmware's own";
}

TEST(FirmwareGuardDeathTest, OwnCrashStaysOurs) {
  EXPECT_EXIT(
      {
        FirmwareGuard::Install();
        FirmwareGuard::Call(FirmwareCall::kGrant,
                            [] { FirmwareGuard::CallBack([] { return raise(SIGSEGV); }); });
      },
      ::testing::KilledBySignal(SIGSEGV), "");
}

TEST(FirmwareGuardDeathTest, OwnExitStaysOurs) {
  EXPECT_EXIT(
      {
        FirmwareGuard::Install();
        FirmwareGuard::Call(FirmwareCall::kGrant, [] {});
        std::exit(9);
      },
      ::testing::ExitedWithCode(9), "");
}

}  // namespace
}  // namespace tiltproof::harness
