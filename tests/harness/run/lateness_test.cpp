// The harness's own lateness, and the limits on how much it records.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "harness/run/event_limit.h"
#include "harness/run/late_periods.h"
#include "harness/run/realtime/log_messages.h"
#include "harness/run/realtime/send_backlog.h"
#include "tests/support/control_period.h"

namespace tiltproof::harness {
namespace {

// Period by period.
std::int64_t SlowOverrunCount(const RunLog& log) {
  std::int64_t count = 0;
  for (TimeNs begin_ns = 0; begin_ns < log.end_ns; begin_ns += kControlPeriodNs) {
    const TimeNs end_ns = std::min(begin_ns + kControlPeriodNs, log.end_ns);
    count += std::any_of(log.harness_late.begin(), log.harness_late.end(), [&](const LateSpan& late) {
      return late.begin_ns < end_ns && late.end_ns >= begin_ns;
    });
  }
  return count;
}

TEST(CountLateness, AgreesWithACountPeriodByPeriod) {
  std::mt19937_64 random(3);
  const auto below = [&](TimeNs limit) {
    return static_cast<TimeNs>(random() % static_cast<std::uint64_t>(limit));
  };
  for (int turn = 0; turn < 500; ++turn) {
    RunLog log;
    log.end_ns = kNsPerS + below(kNsPerS);
    TimeNs longest = 0;
    for (TimeNs i = below(30); i > 0; --i) {
      const TimeNs begin_ns = below(2500 * kNsPerMs) - 100 * kNsPerMs;
      const TimeNs end_ns = std::max<TimeNs>(begin_ns, 0) + 3 * kNsPerMs + below(60 * kNsPerMs);
      log.harness_late.push_back({begin_ns, end_ns});
      if (begin_ns < log.end_ns) longest = std::max(longest, end_ns - begin_ns);
    }
    std::sort(log.harness_late.begin(), log.harness_late.end(),
              [](const LateSpan& a, const LateSpan& b) { return a.begin_ns < b.begin_ns; });
    CountLateness(log, kControlPeriodNs);
    EXPECT_EQ(log.harness_overrun_count, SlowOverrunCount(log));
    EXPECT_EQ(log.harness_late_max_ns, longest);
  }
}

TEST(CountLateness, WhatIsLateWhileTheLogsAreGatheredIsNoOverrun) {
  RunLog log;
  log.end_ns = kNsPerS;
  log.harness_late = {{kNsPerS, 2 * kNsPerS}};
  CountLateness(log, kControlPeriodNs);
  EXPECT_EQ(log.harness_overrun_count, 0);
  EXPECT_EQ(log.harness_late_max_ns, 0);
}

// Bytes that waited for the harness until t = 0 arrive together then.
TEST(CountLateness, LatenessJustBeforeTheFlightExcusesButDoesNotCount) {
  RunLog log;
  log.end_ns = kNsPerS;
  log.harness_late = {
      {-2 * kNsPerS, -kNsPerS}, {-100 * kNsPerMs, -1}, {2 * kNsPerS, kNever}};  // a node may say anything
  CountLateness(log, kControlPeriodNs);
  EXPECT_EQ(log.harness_late, (std::vector<LateSpan>{{-100 * kNsPerMs, -1}, {2 * kNsPerS, kNever}}));
  EXPECT_EQ(log.harness_overrun_count, 0);
  EXPECT_EQ(log.harness_late_max_ns, 0);
}

TEST(Lateness, NotesWhatIsTooLate) {
  Lateness lateness{.late_after_ns = 3 * kNsPerMs};
  constexpr BootTime kDue(100);
  lateness.Note(kDue, kDue + 3 * kNsPerMs);
  EXPECT_TRUE(lateness.spans.empty());
  lateness.Note(kDue, kDue + 3 * kNsPerMs + 1);
  EXPECT_EQ(lateness.spans, (std::vector<NodeLateSpan>{{kDue, kDue + 3 * kNsPerMs + 1}}));
}

// A firmware must not be blamed for what the machine did after the account was full.
TEST(Lateness, WhenTheAccountIsFullTheRestIsOneLongLateness) {
  Lateness lateness{.late_after_ns = 3 * kNsPerMs};
  const auto count = static_cast<TimeNs>(Lateness::kSpansMax);
  const auto due = [](TimeNs second) { return BootTime(second * kNsPerS); };
  for (TimeNs i = 0; i < count; ++i) lateness.Note(due(i), due(i) + 4 * kNsPerMs);
  lateness.Note(due(count + 10), due(count + 10) + 5 * kNsPerMs);
  ASSERT_EQ(lateness.spans.size(), Lateness::kSpansMax);
  EXPECT_EQ(lateness.spans.back(), (NodeLateSpan{due(count - 1), due(count + 10) + 5 * kNsPerMs}));
}

// States of 37 bytes, one every 4 ms. The process that hands them over stands still for a while; then all come at once.
TEST(SendBacklog, LastsUntilStatesAreAPeriodApartAgain) {
  constexpr TimeNs kPeriod = 4 * kNsPerMs;
  constexpr std::int64_t kStateBytes = 37, kGapBegin = 50;
  for (const std::int64_t baud : {125'000, 250'000, 1'000'000}) {
    for (std::int64_t missed_count = 0; missed_count < 100; ++missed_count) {
      const link::LineRate rate{.baud = baud};
      const std::int64_t gap_end = kGapBegin + missed_count;
      Lateness lateness{.late_after_ns = 3 * kNsPerMs};
      const TimeNs usual_ns = kPeriod / 2 + rate.BytesTime(kStateBytes);
      SendBacklog backlog(rate, usual_ns);
      BootTime sent_ns(0), excused_until_ns(0), together_until_ns(0);
      for (std::int64_t i = 0; i < 1000; ++i) {
        const bool is_late = i >= kGapBegin && i < gap_end;
        const BootTime now((is_late ? gap_end : i) * kPeriod);
        if (const auto until = backlog.Take(now, kStateBytes)) lateness.NoteBacklog(now, *until);
        // The slow way: each byte waits for the one before.
        const BootTime last_ns = sent_ns;
        for (std::int64_t byte = 0; byte < kStateBytes; ++byte)
          sent_ns = std::max(sent_ns, now) + 10 * kNsPerS / baud;
        if (i > 0 && sent_ns - last_ns < kPeriod / 2) together_until_ns = sent_ns;
      }
      for (const NodeLateSpan& span : lateness.spans) {
        EXPECT_GE(span.begin_ns, BootTime(gap_end * kPeriod));
        excused_until_ns = std::max(excused_until_ns, span.end_ns);
      }
      // A period around what is late is not judged, either (harness/score/clean_line.h).
      if (together_until_ns > BootTime(gap_end * kPeriod) + kPeriod) {
        EXPECT_GE(excused_until_ns + kPeriod, together_until_ns) << baud << " " << missed_count;
      }
      // A short backlog does not bring states together afterwards.
      const bool is_long = (missed_count + 1) * rate.BytesTime(kStateBytes) > usual_ns;
      EXPECT_EQ(!lateness.spans.empty(), missed_count > 0 && is_long) << baud << " " << missed_count;
      EXPECT_LE(excused_until_ns, BootTime(gap_end * kPeriod) + 4 * (missed_count + 1) * kPeriod);
    }
  }
}

TEST(EventLimit, SaysOnceThatItSaysNoMore) {
  EventLimit limit;
  for (std::size_t i = 0; i < EventLimit::kEventsMax; ++i)
    ASSERT_EQ(limit.Pass("rejected", "to_plant")->kind, "rejected") << i;
  EXPECT_EQ(limit.Pass("rejected", "to_plant")->kind, "events_suppressed");
  EXPECT_FALSE(limit.Pass("rejected", "to_plant"));
}

}  // namespace
}  // namespace tiltproof::harness
