// Ticks of a timer, and whether this machine took them from the firmware. The series are made by a small machine that knows
// of each instant whether the emulator stood still; a slow reference judges by that, the rule by its three numbers a tick.
#include "harness/emulator/plugin/tick_rule.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cstdint>
#include <vector>

namespace tiltproof::qemu {
namespace {

constexpr std::int64_t kUs = 1'000, kMs = 1'000'000;

struct Interval {
  std::int64_t begin_ns, end_ns;
  bool Has(std::int64_t at_ns) const { return begin_ns <= at_ns && at_ns < end_ns; }
};
using Intervals = std::vector<Interval>;

bool Has(const Intervals& intervals, std::int64_t at_ns) {
  return std::any_of(intervals.begin(), intervals.end(), [&](const Interval& one) { return one.Has(at_ns); });
}

// A firmware on this machine, microsecond by microsecond. It takes a tick when it runs with its interrupts on, and works
// for a while then; otherwise it sleeps. In its masked times it works, with its interrupts off.
struct Machine {
  Intervals stopped = {};      // the processor's thread does not run; the timer's does
  Intervals stood_still = {};  // nor does the timer's: its ticks are late, and then come at once
  Intervals masked = {};
  std::int64_t work_ns = 100 * kUs;

  struct Told {
    std::vector<TickRule::Now> ticks;
    std::vector<bool>
        by_the_machine;  // of each tick: lost, and the emulator stood still since the one before was due
  };

  bool Runs(std::int64_t at_ns) const { return !Has(stopped, at_ns) && !Has(stood_still, at_ns); }

  Told Run(const std::vector<std::int64_t>& due_ns, std::int64_t end_ns) const {
    Told told;
    std::int64_t run_ns = 0, work_left_ns = 0;
    std::size_t next = 0;
    bool pending = false;
    for (std::int64_t now = 0; now < end_ns; now += kUs) {
      for (; !Has(stood_still, now) && next < due_ns.size() && due_ns[next] <= now; ++next) {
        bool stood = false;
        for (std::int64_t at = next == 0 ? now : due_ns[next - 1]; at < now; at += kUs) stood |= !Runs(at);
        told.ticks.push_back({now, run_ns, pending});
        told.by_the_machine.push_back(pending && stood);
        pending = true;
      }
      if (!Runs(now)) continue;
      const bool off = Has(masked, now);
      if (pending && !off) {
        pending = false;
        work_left_ns = work_ns;
      }
      if (!off && work_left_ns <= 0) continue;
      run_ns += kUs;
      if (!off) work_left_ns -= kUs;
    }
    return told;
  }
};

std::vector<std::int64_t> EveryMillisecond(int count) {
  std::vector<std::int64_t> due_ns;
  for (int i = 1; i <= count; ++i) due_ns.push_back(i * kMs);
  return due_ns;
}

std::vector<TickRule::Span> LostIn(const std::vector<TickRule::Now>& ticks) {
  TickRule rule;
  std::vector<TickRule::Span> lost;
  for (const auto& tick : ticks)
    if (const auto span = rule.Tick(tick)) lost.push_back(*span);
  return lost;
}

std::size_t CountLost(const Machine& machine, const std::vector<std::int64_t>& due_ns) {
  return LostIn(machine.Run(due_ns, due_ns.back() + 5 * kMs).ticks).size();
}

TEST(TickRule, TicksThatAreTakenAreNotLost) { EXPECT_EQ(CountLost({}, EveryMillisecond(100)), 0u); }

TEST(TickRule, OneThatTheThreadSleptOverIsLost) {
  // The tick at 10 ms stays pending, that at 11 ms is lost.
  const auto lost =
      LostIn(Machine{.stopped = {{9'500 * kUs, 11'500 * kUs}}}.Run(EveryMillisecond(20), 20 * kMs).ticks);
  ASSERT_EQ(lost.size(), 1u);
  EXPECT_EQ(lost[0].begin_ns, 10 * kMs);
  EXPECT_EQ(lost[0].end_ns, 11 * kMs);
}

TEST(TickRule, AShortWaitLosesNone) {
  EXPECT_EQ(CountLost({.stopped = {{9'500 * kUs, 10'500 * kUs}}}, EveryMillisecond(20)), 0u);
}

TEST(TickRule, SeveralInOneGapAreEachLost) {
  // Those at 10 to 14 ms came, and the firmware took one.
  EXPECT_EQ(CountLost({.stopped = {{9'500 * kUs, 14'500 * kUs}}}, EveryMillisecond(20)), 4u);
}

TEST(TickRule, AfterAStandstillItIsTheStandstillThatIsTold) {
  // Nothing runs for 100 ms. Then the timer's thread delivers all before the processor's takes one.
  const Machine machine{.stopped = {{10'500 * kUs, 110'550 * kUs}},
                        .stood_still = {{10'500 * kUs, 110'500 * kUs}}};
  const auto lost = LostIn(machine.Run(EveryMillisecond(150), 150 * kMs).ticks);
  ASSERT_EQ(lost.size(), 99u);
  EXPECT_EQ(lost[0].begin_ns, 10 * kMs);
  EXPECT_EQ(lost[0].end_ns, 110'500 * kUs);
  EXPECT_EQ(lost[98].begin_ns, 10 * kMs);
}

TEST(TickRule, EarlyAndLateTicksThatAreTakenAreNotLost) {
  std::vector<std::int64_t> due_ns = EveryMillisecond(100);
  for (std::size_t i = 0; i < due_ns.size(); ++i)
    due_ns[i] += (static_cast<std::int64_t>(i * 7919 % 801) - 400) * kUs;
  EXPECT_EQ(CountLost({}, due_ns), 0u);
}

TEST(TickRule, WhatTheFirmwareLosesItselfIsNotTold) {
  // It works for 5 ms with its interrupts off.
  EXPECT_EQ(CountLost({.masked = {{9'500 * kUs, 14'500 * kUs}}}, EveryMillisecond(20)), 0u);
  // Though this machine takes a fifth of the time from it.
  EXPECT_EQ(CountLost({.stopped = {{11'200 * kUs, 11'400 * kUs}, {12'200 * kUs, 12'400 * kUs}},
                       .masked = {{9'500 * kUs, 14'500 * kUs}}},
                      EveryMillisecond(20)),
            0u);
}

TEST(TickRule, ATimerThatTheFirmwareStopsOrSetsAnewLosesNone) {
  const auto with_gap = [](std::int64_t gap_ns, std::int64_t period_ns) {
    std::vector<std::int64_t> due_ns = EveryMillisecond(10);
    for (int i = 0; i < 10; ++i) due_ns.push_back(10 * kMs + gap_ns + i * period_ns);
    return due_ns;
  };
  EXPECT_EQ(CountLost({}, with_gap(300 * kMs, kMs)), 0u);        // off for a while
  EXPECT_EQ(CountLost({}, with_gap(7 * kMs, 7 * kMs)), 0u);      // slower from then on
  EXPECT_EQ(CountLost({}, with_gap(250 * kUs, 250 * kUs)), 0u);  // faster
  // It was off on purpose: no part of what this machine takes afterwards.
  const auto due_ns = with_gap(300 * kMs, kMs);
  const auto lost = LostIn(Machine{.stopped = {{309'500 * kUs, 311'500 * kUs}}}.Run(due_ns, 330 * kMs).ticks);
  ASSERT_EQ(lost.size(), 1u);
  EXPECT_EQ(lost[0].begin_ns, 310 * kMs);
}

// The thread worked before the standstill of the timer's: that began later.
TEST(TickRule, ATickThatComesAtOnceBeginsNoEarlierThanItsPair) {
  const auto lost =
      LostIn({{1 * kMs, 0, false}, {2 * kMs, 900 * kUs, false}, {2 * kMs + 10 * kUs, 900 * kUs, true}});
  ASSERT_EQ(lost.size(), 1u);
  EXPECT_EQ(lost[0].begin_ns, 2 * kMs);
}

// Against the machine's own knowledge: a tick that is lost after the emulator stood still for most of the time since the
// one before.
RC_GTEST_PROP(TickRule, TellsWhatTheMachineTook, ()) {
  Machine machine;
  machine.work_ns = *rc::gen::inRange(10, 900) * kUs;
  const std::int64_t end_ns = 60 * kMs;
  const auto intervals = [&](int count_max, int length_max_us) {
    Intervals made;
    for (int count = *rc::gen::inRange(0, count_max + 1); count > 0; --count) {
      const std::int64_t begin_ns = *rc::gen::inRange<std::int64_t>(0, end_ns / kUs) * kUs;
      made.push_back({begin_ns, begin_ns + *rc::gen::inRange(1, length_max_us) * kUs});
    }
    return made;
  };
  machine.stopped = intervals(4, 6'000);
  machine.stood_still = intervals(2, 9'000);
  // A firmware that never turns its interrupts off loses no tick by itself: each that is lost, the machine took.
  const auto told = machine.Run(EveryMillisecond(60), end_ns);
  TickRule rule;
  for (std::size_t i = 0; i < told.ticks.size(); ++i) {
    const auto& tick = told.ticks[i];
    const auto lost = rule.Tick(tick);
    if (lost) {
      RC_ASSERT(told.by_the_machine[i]);
      RC_ASSERT(lost->end_ns == tick.at_ns);
      // Within the span the emulator did stand still.
      bool stood = false;
      for (std::int64_t at = lost->begin_ns; at <= lost->end_ns; at += kUs)
        stood |= Has(machine.stopped, at) || Has(machine.stood_still, at);
      RC_ASSERT(stood);
    }
    // It missed a tick although it did not run at all in between.
    const bool none_ran = i > 0 && tick.run_ns == told.ticks[i - 1].run_ns;
    if (told.by_the_machine[i] && none_ran) RC_ASSERT(lost.has_value());
  }
}

// The clock counts from the start of the machine, long before.
TEST(TickRule, NothingWasLostBeforeTheProcessorRan) {
  constexpr std::int64_t kBegan = 79'924 * std::int64_t{1'000'000'000};
  TickRule rule({.at_ns = kBegan, .run_ns = kMs, .pending = false});
  EXPECT_FALSE(rule.Tick({.at_ns = kBegan + 30 * kMs, .run_ns = 2 * kMs, .pending = false}));
  const auto lost = rule.Tick({.at_ns = kBegan + 30 * kMs + 10 * kUs, .run_ns = 2 * kMs, .pending = true});
  ASSERT_TRUE(lost);
  EXPECT_EQ(lost->begin_ns, kBegan);
}

}  // namespace
}  // namespace tiltproof::qemu
