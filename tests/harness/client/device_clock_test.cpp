#include "harness/client/device_clock.h"

#include <gtest/gtest.h>
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

}  // namespace
}  // namespace tiltproof::harness
