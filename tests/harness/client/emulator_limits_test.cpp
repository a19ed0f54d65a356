#include "harness/client/emulator_limits.h"

#include <gtest/gtest.h>

#include <string>

namespace tiltproof::harness {
namespace {

std::string Text(TimeNs at) { return std::to_string(at / kNsPerMs) + " ms"; }

TEST(EmulatorLimits, ASecondThatCostsTooMuchIsFound) {
  EmulatorLimits limits;
  EXPECT_FALSE(limits.CostsTooMuch(500 * kNsPerMs, 9 * kNsPerS));
  EXPECT_EQ(limits.LeftForTurn(), kNsPerS);
  EXPECT_FALSE(limits.CostsTooMuch(1000 * kNsPerMs, 9 * kNsPerS));  // a second has passed: another one begins
  EXPECT_EQ(limits.LeftForTurn(), EmulatorLimits::kTurnNs);
  EXPECT_FALSE(limits.CostsTooMuch(1100 * kNsPerMs, 18 * kNsPerS));
  EXPECT_TRUE(limits.CostsTooMuch(1100 * kNsPerMs, 19 * kNsPerS));
  EXPECT_EQ(limits.second_begin(), kNsPerS);
  EXPECT_EQ(limits.second_cost_ns(), 10 * kNsPerS);
  EXPECT_GT(limits.LeftForTurn(), 0);  // which would be no limit
}

TEST(EmulatorLimits, AnImageAtTheLimitFlies) {
  EmulatorLimits limits;
  for (TimeNs now = 0, used = 0; now < 100 * kNsPerS; now += 10 * kNsPerMs, used += 99 * kNsPerMs)
    ASSERT_FALSE(limits.CostsTooMuch(now, used)) << now;
}

TEST(EmulatorLimits, ProcessorTimeThatCannotBeReadIsNone) {
  EmulatorLimits limits;
  EXPECT_FALSE(limits.CostsTooMuch(100 * kNsPerMs, 6 * kNsPerS));
  EXPECT_FALSE(limits.CostsTooMuch(200 * kNsPerMs, 0));
  EXPECT_EQ(limits.second_cost_ns(), 6 * kNsPerS);
}

TEST(EmulatorLimits, OneResetTooManyWithinTheTime) {
  EmulatorLimits limits;
  for (int i = 0; i < EmulatorLimits::kResetsMax; ++i) {
    limits.OnReset(i * 100 * kNsPerMs, "reset by watchdog");
    ASSERT_EQ(limits.Broken(Text), "");
  }
  limits.OnReset(10 * kNsPerS, "reset by watchdog: in Main (main.c:7)");
  EXPECT_EQ(limits.Broken(Text),
            "the firmware resets again and again: 101 times within 10.000000 s, since 0 ms (limit: 100 times "
            "within 10 s); "
            "the last time it was reset by watchdog: in Main (main.c:7)");
}

TEST(EmulatorLimits, AWatchdogThatBitesNowAndThenIsNoLoop) {
  EmulatorLimits limits;
  for (TimeNs now = 0; now < 3600 * kNsPerS; now += 101 * kNsPerMs) limits.OnReset(now, "reset by watchdog");
  EXPECT_EQ(limits.Broken(Text), "");
}

TEST(EmulatorLimits, TheFirstBrokenLimitIsTold) {
  EmulatorLimits limits;
  limits.OnBrokenLimit(3 * kNsPerMs, "RCC_CFGR");
  limits.OnBrokenLimit(4 * kNsPerMs, "FLASH_ACR");
  EXPECT_EQ(limits.Broken(Text), "the firmware sets what no chip does, 3 ms: RCC_CFGR");
}

}  // namespace
}  // namespace tiltproof::harness
