// Crashes and hangs of the firmware become exceptions, again and again, and the harness's own crash stays a
// crash.

#include <gtest/gtest.h>

#include <csignal>

#include "harness/client/firmware_guard.h"

namespace tiltproof::harness {
namespace {

TEST(FirmwareGuard, ReturnsWhatTheCallReturns) {
  FirmwareGuard::Install();
  EXPECT_EQ(FirmwareGuard::Call([] { return 42; }), 42);
}

TEST(FirmwareGuard, TurnsEverySignalIntoTroubleMoreThanOnce) {
  FirmwareGuard::Install();
  for (int round = 0; round < 2; ++round) {
    for (const int signal_number : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT}) {
      try {
        FirmwareGuard::Call([&] { raise(signal_number); });
        ADD_FAILURE() << "signal " << signal_number << " was not caught";
      } catch (const FirmwareTrouble& trouble) {
        EXPECT_FALSE(trouble.hung);
      }
    }
  }
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
  EXPECT_THROW(FirmwareGuard::Call([&] { return Recursion::Deeper(start); }), FirmwareTrouble);
}

TEST(FirmwareGuard, EndsACallThatNeverReturns) {
  FirmwareGuard::Install();
  try {
    FirmwareGuard::Call([] {
      for (volatile bool forever = true; forever;) {
      }
    });
    ADD_FAILURE() << "it returned";
  } catch (const FirmwareTrouble& trouble) {
    EXPECT_TRUE(trouble.hung);
  }
}

TEST(FirmwareGuardDeathTest, OwnCrashStaysOurs) {
  EXPECT_EXIT(
      {
        FirmwareGuard::Install();
        FirmwareGuard::Call([] {
          const FirmwareGuard::Outside outside;
          raise(SIGSEGV);
        });
      },
      ::testing::KilledBySignal(SIGSEGV), "");
}

}  // namespace
}  // namespace tiltproof::harness
