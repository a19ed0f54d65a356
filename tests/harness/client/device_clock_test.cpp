#include "harness/client/device_clock.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>
// rapidcheck wants gtest first.
#include <rapidcheck/gtest.h>

namespace tiltproof::harness {
namespace {

TEST(DeviceClock, WithoutDriftShowsTheTime) {
  const DeviceClock clock;
  for (const TimeNs time : {TimeNs{0}, TimeNs{1}, 3600 * kNsPerS, kNever}) {
    EXPECT_EQ(clock.At(BootTime(time)), time);
    EXPECT_EQ(clock.When(time), BootTime(time));
  }
}

TEST(DeviceClock, GainsWhatItsDriftSays) {
  DeviceClock clock;
  clock.Drift(BootTime(10 * kNsPerS), BootTime(20 * kNsPerS), 100.0);
  EXPECT_EQ(clock.At(BootTime(10 * kNsPerS)), 10 * kNsPerS);
  EXPECT_EQ(clock.At(BootTime(15 * kNsPerS)), 15 * kNsPerS + 500 * kNsPerUs);
  EXPECT_EQ(clock.At(BootTime(3600 * kNsPerS)), 3600 * kNsPerS + kNsPerMs);
  EXPECT_EQ(clock.When(15 * kNsPerS + 500 * kNsPerUs), BootTime(15 * kNsPerS));
}

TEST(DeviceClock, OverlappingDriftsAddUp) {
  DeviceClock clock;
  clock.Drift(BootTime(), BootTime::Never(), 100.0);
  clock.Drift(BootTime(), BootTime::Never(), -40.0);
  EXPECT_EQ(clock.At(BootTime(1000 * kNsPerS)), 1000 * kNsPerS + 60 * kNsPerMs);
}

// Compares the clock with a sum of windows of one rate each, computed in floating point.
RC_GTEST_PROP(DeviceClock, IsMonotoneInvertibleAndRight, ()) {
  DeviceClock clock;
  double gained_s = 0;
  const BootTime at(*rc::gen::inRange<TimeNs>(0, 14'400 * kNsPerS));
  const int count = *rc::gen::inRange(0, 4);
  for (int i = 0; i < count; ++i) {
    const BootTime begin(*rc::gen::inRange<TimeNs>(0, 14'400 * kNsPerS));
    const BootTime end = begin + *rc::gen::inRange<TimeNs>(1, 14'400 * kNsPerS);
    const double ppm = *rc::gen::inRange(-10'000, 10'001);
    clock.Drift(begin, end, ppm);
    gained_s += ToSeconds(std::max<TimeNs>(std::min(at, end) - begin, 0)) * ppm * 1e-6;
  }
  const TimeNs shown = clock.At(at);
  RC_ASSERT(std::abs(ToSeconds(shown - at.ns()) - gained_s) < 1e-8);
  RC_ASSERT(clock.At(at + 1) >= shown);
  const BootTime when = clock.When(shown);
  RC_ASSERT(when <= at);
  RC_ASSERT(clock.At(when) >= shown);
  RC_ASSERT(when == BootTime() || clock.At(when - 1) < shown);
}

TEST(DeviceClock, AJumpForwardIsAtOnceAndIsRevertedByStandingStill) {
  DeviceClock clock;
  clock.Jump(BootTime(10 * kNsPerS), BootTime(20 * kNsPerS), 5 * kNsPerMs);
  EXPECT_EQ(clock.At(BootTime(10 * kNsPerS - 1)), 10 * kNsPerS - 1);
  EXPECT_EQ(clock.At(BootTime(10 * kNsPerS)), 10 * kNsPerS + 5 * kNsPerMs);
  // All that was due in between is due at the jump.
  EXPECT_EQ(clock.When(10 * kNsPerS + 3 * kNsPerMs), BootTime(10 * kNsPerS));
  EXPECT_EQ(clock.At(BootTime(20 * kNsPerS + 2 * kNsPerMs)), 20 * kNsPerS + 5 * kNsPerMs - 1);
  EXPECT_EQ(clock.At(BootTime(20 * kNsPerS + 6 * kNsPerMs)), 20 * kNsPerS + 6 * kNsPerMs);
  EXPECT_EQ(clock.When(20 * kNsPerS + 7 * kNsPerMs), BootTime(20 * kNsPerS + 7 * kNsPerMs));
}

TEST(DeviceClock, AJumpBackAtPowerOnShowsZeroUntilItHasCaughtUp) {
  DeviceClock clock;
  clock.Jump(BootTime(), BootTime::Never(), -3 * kNsPerS);
  EXPECT_EQ(clock.At(BootTime()), 0);
  EXPECT_EQ(clock.At(BootTime(3 * kNsPerS)), 0);
  EXPECT_EQ(clock.At(BootTime(4 * kNsPerS)), kNsPerS);
  EXPECT_EQ(clock.When(kNsPerS), BootTime(4 * kNsPerS));
}

// A clock that is read every nanosecond: it has a hand, which never goes back.
RC_GTEST_PROP(DeviceClock, JumpsAreThoseOfAHandThatNeverGoesBack, ()) {
  struct Jump {
    TimeNs begin, end, by;
  };
  constexpr TimeNs kLength = 2000;
  DeviceClock clock;
  std::vector<Jump> jumps;
  for (int i = *rc::gen::inRange(0, 4); i > 0; --i) {
    const TimeNs begin = *rc::gen::inRange<TimeNs>(0, kLength);
    const TimeNs length = *rc::gen::inRange<TimeNs>(1, kLength);
    jumps.push_back({begin, begin + length, *rc::gen::inRange<TimeNs>(-500, 500)});
    clock.Jump(BootTime(begin), BootTime(begin + length), jumps.back().by);
  }
  TimeNs hand = 0;
  for (TimeNs t = 0; t < kLength; ++t) {
    TimeNs reading = t;
    for (const Jump& jump : jumps)
      if (jump.begin <= t && t < jump.end) reading += jump.by;
    const TimeNs before = hand;
    hand = std::max(hand, reading);
    RC_ASSERT(clock.At(BootTime(t)) == hand);
    // All readings that have just been reached.
    if (hand > before) RC_ASSERT(clock.When(hand) == BootTime(t));
    if (hand > before) RC_ASSERT(clock.When(before + 1) == BootTime(t));
  }
}

}  // namespace
}  // namespace tiltproof::harness
