#include "harness/emulator/plugin/turn_sleep.h"

#include <gtest/gtest.h>

#include <cstdint>

namespace tiltproof::qemu {
namespace {

TEST(TurnSleep, AProcessorThatSleepsForAWholeTurnSleepsUntilTheNextTimer) {
  TurnSleep sleep;
  sleep.Begin(1'000, 500);
  sleep.Sleeps(1'000);
  EXPECT_EQ(sleep.Until(1'100), 1'500);
  EXPECT_EQ(sleep.Until(1'499), 1'500);
}

TEST(TurnSleep, ATimerThatWasDueMayHaveWokenIt) {
  TurnSleep sleep;
  sleep.Begin(1'000, 500);
  sleep.Sleeps(1'000);
  EXPECT_EQ(sleep.Until(1'500), 1'500);
  EXPECT_EQ(sleep.Until(2'000), 2'000);
}

TEST(TurnSleep, AProcessorThatHasExecutedSomethingMayHaveSetTimers) {
  TurnSleep sleep;
  sleep.Begin(1'000, 500);
  sleep.Sleeps(1'008);
  EXPECT_EQ(sleep.Until(1'100), 1'100);
}

TEST(TurnSleep, EachTurnBeginsAgain) {
  TurnSleep sleep;
  sleep.Begin(1'000, 500);
  sleep.Sleeps(1'000);
  sleep.Begin(1'100, 400);
  EXPECT_EQ(sleep.Until(1'200), 1'200);
}

TEST(TurnSleep, WithoutTimersItSleepsForEver) {
  TurnSleep sleep;
  sleep.Begin(1'000, -1);
  sleep.Sleeps(1'000);
  EXPECT_EQ(sleep.Until(1'100), INT64_MAX);
}

}  // namespace
}  // namespace tiltproof::qemu
