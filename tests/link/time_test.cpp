// Boot time and simulation time do not mix, and an origin makes one of the other.

#include "link/time.h"

#include <gtest/gtest.h>
// rapidcheck wants gtest first.
#include <rapidcheck/gtest.h>

#include <concepts>
#include <type_traits>

#include "faults/fault.h"
#include "link/chunk.h"

namespace tiltproof {
namespace {

template <class A, class B>
concept Adds = requires(A a, B b) {
  a + b;
};
template <class A, class B>
concept Subtracts = requires(A a, B b) {
  a - b;
};
template <class A, class B>
concept Increases = requires(A a, B b) {
  a += b;
};
template <class A, class B>
concept Compares = requires(A a, B b) {
  a < b;
};
template <class A, class B>
concept Equals = requires(A a, B b) {
  a == b;
};
template <class T>
concept Scales = requires(T t) {
  t * 2;
}
|| requires(T t) { t / 2; }
|| requires(T t) { t % 2; };

// Neither becomes the other unasked.
static_assert(!std::is_convertible_v<TimeNs, BootTime> && !std::is_convertible_v<int, BootTime>);
static_assert(!std::is_convertible_v<BootTime, TimeNs> && !std::is_constructible_v<TimeNs, BootTime>);
static_assert(!std::is_assignable_v<BootTime&, TimeNs> && !std::is_assignable_v<TimeNs&, BootTime>);
static_assert(!std::is_convertible_v<BootTime, Origin> && !std::is_constructible_v<Origin, TimeNs>);
// Nor do they compare.
static_assert(!Compares<BootTime, TimeNs> && !Compares<TimeNs, BootTime>);
static_assert(!Equals<BootTime, TimeNs> && !Equals<TimeNs, BootTime>);
static_assert(Compares<BootTime, BootTime> && Equals<BootTime, BootTime>);
// An instant has no sum with another, no double and no half. A duration does not become one.
static_assert(!Adds<BootTime, BootTime> && !Adds<TimeNs, BootTime> && !Subtracts<TimeNs, BootTime>);
static_assert(!Increases<BootTime&, BootTime> && !Increases<TimeNs&, BootTime> && !Scales<BootTime>);
static_assert(std::same_as<decltype(BootTime() + TimeNs()), BootTime>);
static_assert(std::same_as<decltype(BootTime() - TimeNs()), BootTime>);
static_assert(std::same_as<decltype(BootTime() - BootTime()), TimeNs>);
// An origin takes each the right way.
static_assert(!std::is_invocable_v<decltype(&Origin::SimulationTime), Origin, TimeNs>);
static_assert(!std::is_invocable_v<decltype(&Origin::ToBootTime), Origin, BootTime>);
// Records of a line are none of a log.
static_assert(!std::is_convertible_v<link::Chunk, link::LogChunk>);
static_assert(!std::is_convertible_v<faults::BootActivation, faults::Activation>);
// It costs what a number costs.
static_assert(std::is_trivially_copyable_v<BootTime> && sizeof(BootTime) == sizeof(TimeNs));
static_assert(std::is_trivially_copyable_v<Origin> && sizeof(Origin) == sizeof(TimeNs));

TEST(BootTime, CountsFromPowerOn) {
  EXPECT_EQ(BootTime(), BootTime(0));
  EXPECT_EQ(BootTime(5).ns(), 5);
  BootTime t(5);
  t += 3;
  EXPECT_EQ(t, BootTime(8));
  EXPECT_EQ(t - 10, BootTime(-2));
  EXPECT_EQ(t - BootTime(5), 3);
  EXPECT_LT(BootTime::Earliest(), BootTime(kPowerOn + 1));
  EXPECT_GT(BootTime::Never(), BootTime(kNever - 1));
}

TEST(Origin, IsUnknownAtFirst) {
  const Origin origin;
  EXPECT_FALSE(origin.known());
  EXPECT_EQ(origin.boot_time(), BootTime::Never());
  for (const BootTime t : {BootTime::Earliest(), BootTime(-1), BootTime(), BootTime(kNsPerS)})
    EXPECT_EQ(origin.SimulationTime(t), kPowerOn);
}

TEST(Origin, WithoutOneTheLogCountsFromPowerOn) {
  EXPECT_TRUE(Origin().OrPowerOn().known());
  EXPECT_EQ(Origin().OrPowerOn().SimulationTime(BootTime(7)), 7);
  EXPECT_EQ(Origin().OrPowerOn().ToBootTime(7), BootTime(7));
  EXPECT_EQ(Origin(BootTime(3)).OrPowerOn(), Origin(BootTime(3)));
}

TEST(Origin, WhatHasNoBeginOrNoEndHasNoneInTheOtherTime) {
  const Origin origin(BootTime{kNsPerS});
  EXPECT_EQ(origin.SimulationTime(BootTime::Earliest()), kPowerOn);
  EXPECT_EQ(origin.ToBootTime(kNever), BootTime::Never());
}

RC_GTEST_PROP(Origin, IsZeroOfSimulationTime, ()) {
  const BootTime of_t0(*rc::gen::inRange<TimeNs>(-kNsPerS, 3600 * kNsPerS));
  const BootTime t(*rc::gen::inRange<TimeNs>(-kNsPerS, 3600 * kNsPerS));
  const Origin origin(of_t0);
  RC_ASSERT(origin.known());
  RC_ASSERT(origin.SimulationTime(of_t0) == 0);
  RC_ASSERT(origin.SimulationTime(t) == t.ns() - of_t0.ns());
  RC_ASSERT(origin.ToBootTime(origin.SimulationTime(t)) == t);
  RC_ASSERT((origin.SimulationTime(t) < 0) == (t < of_t0));
}

}  // namespace
}  // namespace tiltproof
