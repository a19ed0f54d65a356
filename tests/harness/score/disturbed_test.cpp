// Time that this machine took: no criterion blames the firmware for it, and it hides nothing else.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <optional>
#include <string>
#include <vector>

#include "harness/score/score.h"
#include "tests/harness/score/still_flight.h"

namespace tiltproof::harness {
namespace {

using ::testing::HasSubstr;

constexpr TimeNs kMs = kNsPerMs;

// 101 requests, 12 ms apart; the 50th interval is longer.
RunLog FlightWithALongInterval(TimeNs longer_ns) {
  RunLog log = StillFlight(151);
  TimeNs now_ns = 0;
  for (int i = 0; i <= 100; ++i) {
    log.clients[0].request_times_ns.push_back(now_ns);
    now_ns += 12 * kMs + (i == 50 ? longer_ns : 0);
  }
  return log;
}
constexpr TimeNs kLongBegin = 50 * 12 * kMs;

CriterionSpec MineOn(const std::string& metric, std::optional<double> min, std::optional<double> max) {
  CriterionSpec spec;
  spec.name = "mine";
  spec.metric = metric;
  spec.min = min;
  spec.max = max;
  return spec;
}

CriterionResult Judged(const RunLog& log, const CriterionSpec& spec) {
  Scenario scenario = ScenarioOf(log);
  scenario.criteria = {spec};
  const Score score = ScoreRun(scenario, log);
  EXPECT_EQ(score.verdict, score.criteria.back().verdict) << score.reason;
  return score.criteria.back();
}
Verdict VerdictOn(const RunLog& log, const std::string& metric, std::optional<double> min,
                  std::optional<double> max) {
  return Judged(log, MineOn(metric, min, max)).verdict;
}

TEST(Disturbed, AnIntervalThatThisMachineMadeLongerIsNotTheFirmwares) {
  RunLog log = FlightWithALongInterval(5 * kMs);
  for (const char* metric : {"timing.request_period_max_ms", "timing.request_period_p999_ms"}) {
    log.board_disturbed.clear();
    EXPECT_EQ(VerdictOn(log, metric, {}, 15), Verdict::kFail);
    log.board_disturbed = {{100 * kMs, 101 * kMs}};  // elsewhere
    EXPECT_EQ(VerdictOn(log, metric, {}, 15), Verdict::kFail);
    log.board_disturbed = {{kLongBegin + 3 * kMs, kLongBegin + 4 * kMs}};
    EXPECT_EQ(VerdictOn(log, metric, {}, 15), Verdict::kInconclusive);
    EXPECT_EQ(VerdictOn(log, metric, {}, 17), Verdict::kPass);
    EXPECT_EQ(VerdictOn(log, metric, {}, 11), Verdict::kFail);
  }
  const CriterionResult result = Judged(log, MineOn("timing.request_period_max_ms", {}, 15));
  EXPECT_EQ(
      result.explanation,
      "timing.request_period_max_ms = 17, max 15: so only with the periods in which this machine was late; "
      "it was too busy to judge a firmware");
  EXPECT_EQ(result.robustness, -2.0);
  // The harness's own lateness is this machine's, too.
  log.board_disturbed.clear();
  log.harness_late = {{kLongBegin + 1 * kMs, kLongBegin + 5 * kMs}};
  EXPECT_EQ(VerdictOn(log, "timing.request_period_max_ms", {}, 15), Verdict::kInconclusive);
  EXPECT_EQ(VerdictOn(log, "timing.request_jitter_max_ms", {}, 3), Verdict::kInconclusive);
}

TEST(Disturbed, WhatOnlyThisMachineShowedIsNoProofThatAFaultActed) {
  RunLog log = FlightWithALongInterval(5 * kMs);
  EXPECT_EQ(VerdictOn(log, "timing.request_period_max_ms", 15, {}), Verdict::kPass);
  log.board_disturbed = {{kLongBegin + 3 * kMs, kLongBegin + 4 * kMs}};
  EXPECT_EQ(VerdictOn(log, "timing.request_period_max_ms", 15, {}), Verdict::kInconclusive);
  EXPECT_EQ(VerdictOn(log, "timing.request_period_max_ms", 18, {}), Verdict::kFail);
}

// A firmware with absolute times catches up after a wait.
TEST(Disturbed, TheIntervalAfterADisturbedOneMayBeShorter) {
  RunLog log = FlightWithALongInterval(2 * kMs);
  auto& times = log.clients[0].request_times_ns;
  for (std::size_t i = 52; i < times.size(); ++i) times[i] -= 2 * kMs;
  log.board_disturbed = {{kLongBegin + 2 * kMs, kLongBegin + 13 * kMs}};
  EXPECT_EQ(VerdictOn(log, "timing.request_jitter_max_ms", {}, 1), Verdict::kInconclusive);
  times[70] += 2 * kMs;  // its own
  EXPECT_EQ(VerdictOn(log, "timing.request_jitter_max_ms", {}, 1), Verdict::kFail);
}

TEST(Disturbed, TooFewIntervalsTellNothingButTheirLargest) {
  RunLog log = FlightWithALongInterval(5 * kMs);
  // All but the intervals from 600 to 641 ms, of which the first is the long one.
  log.board_disturbed = {{0, kLongBegin - 13 * kMs}, {kLongBegin + 42 * kMs, 1300 * kMs}};
  EXPECT_EQ(VerdictOn(log, "timing.request_period_max_ms", {}, 15), Verdict::kFail);
  EXPECT_EQ(VerdictOn(log, "timing.request_period_p50_ms", {}, 11), Verdict::kInconclusive);
  EXPECT_EQ(VerdictOn(log, "timing.request_period_mean_ms", {}, 11), Verdict::kInconclusive);
  EXPECT_EQ(VerdictOn(log, "timing.request_period_max_ms", 18, {}), Verdict::kInconclusive);
  log.board_disturbed = {{0, 1300 * kMs}};
  EXPECT_EQ(VerdictOn(log, "timing.request_period_max_ms", {}, 15), Verdict::kInconclusive);
  EXPECT_EQ(VerdictOn(log, "timing.request_period_max_ms", {}, 17), Verdict::kPass);
}

TEST(Disturbed, TheMeanIsThatOfTheOthers) {
  RunLog log = FlightWithALongInterval(100 * kMs);
  EXPECT_EQ(VerdictOn(log, "timing.request_period_mean_ms", {}, 12.5), Verdict::kFail);
  log.board_disturbed = {{kLongBegin + 3 * kMs, kLongBegin + 4 * kMs}};
  EXPECT_EQ(VerdictOn(log, "timing.request_period_mean_ms", {}, 12.5), Verdict::kInconclusive);
  EXPECT_EQ(VerdictOn(log, "timing.request_period_mean_ms", {}, 11.5), Verdict::kFail);
}

// It is not known which of these were disturbed: at most as many as there are periods in which this machine was late.
TEST(Disturbed, OfRoundTripsTheWorstMayBeThisMachines) {
  RunLog log = StillFlight(151);
  log.clients[0].client_round_trip_ns.assign(100, kMs);
  log.clients[0].client_round_trip_ns[3] = log.clients[0].client_round_trip_ns[90] = 9 * kMs;
  const auto verdict = [&](const char* metric = "timing.client_round_trip_max_ms") {
    return VerdictOn(log, metric, {}, 5);
  };
  EXPECT_EQ(verdict(), Verdict::kFail);
  log.board_disturbed = {{300 * kMs, 302 * kMs}};  // two periods at most
  EXPECT_EQ(verdict(), Verdict::kInconclusive);
  EXPECT_EQ(verdict("timing.client_round_trip_p50_ms"), Verdict::kPass);
  log.clients[0].client_round_trip_ns[50] = 9 * kMs;
  EXPECT_EQ(verdict(), Verdict::kFail);
  EXPECT_EQ(VerdictOn(log, "timing.client_round_trip_max_ms", 5, {}), Verdict::kPass);
  // A board has no part in when a reply comes.
  log.clients[0].reply_latency_ns = {kMs, 9 * kMs};
  EXPECT_EQ(verdict("timing.reply_latency_max_ms"), Verdict::kFail);
  log.harness_late = {{300 * kMs, 304 * kMs}};
  EXPECT_EQ(verdict("timing.reply_latency_max_ms"), Verdict::kInconclusive);
}

TEST(Disturbed, PeriodsThatABoardMissedInThemMayBeThisMachines) {
  RunLog log = StillFlight(151);
  for (int i = 0; i <= 150; ++i)
    if (i != 40 && i != 100) log.clients[0].actuator_times_ns.push_back(i * 12 * kMs + 2 * kMs);
  const auto verdict = [&] { return VerdictOn(log, "timing.firmware_missed_count", {}, 0); };
  EXPECT_EQ(verdict(), Verdict::kFail);
  log.board_disturbed = {{40 * 12 * kMs, 40 * 12 * kMs + kMs}};
  EXPECT_EQ(verdict(), Verdict::kFail);
  log.board_disturbed.push_back({100 * 12 * kMs, 100 * 12 * kMs + kMs});
  EXPECT_EQ(verdict(), Verdict::kInconclusive);
}

TEST(Disturbed, SilenceAtTheEndLacksWhatThisMachineTook) {
  RunLog log = StillFlight(151);
  log.clients[0].sent_request_times_ns = log.clients[0].actuator_times_ns = {1700 * kMs};
  const auto verdict = [&] { return VerdictOn(log, "timing.silent_at_end_ms", {}, 90); };
  EXPECT_EQ(verdict(), Verdict::kFail);  // 100 ms
  log.board_disturbed = {{1600 * kMs, 1610 * kMs}};
  EXPECT_EQ(verdict(), Verdict::kFail);
  log.board_disturbed = {{1750 * kMs, 1751 * kMs}};
  EXPECT_EQ(verdict(), Verdict::kInconclusive);
}

TEST(Disturbed, ARestartDirectlyAfterAStandstillIsNoProof) {
  RunLog log = StillFlight(151);
  log.clients[0].restarts = {{800 * kMs, "reset by the firmware itself"}};
  const auto verdict = [&](std::vector<LateSpan> late) {
    log.harness_late = std::move(late);
    return ScoreRun(ScenarioOf(log), log).verdict;
  };
  EXPECT_EQ(verdict({}), Verdict::kFail);
  EXPECT_EQ(verdict({{680 * kMs, 700 * kMs}}), Verdict::kInconclusive);
  EXPECT_EQ(verdict({{790 * kMs, 810 * kMs}}), Verdict::kInconclusive);
  EXPECT_EQ(verdict({{500 * kMs, 549 * kMs}}), Verdict::kFail);  // long before
  EXPECT_EQ(verdict({{851 * kMs, 860 * kMs}}), Verdict::kFail);  // after it
  EXPECT_EQ(verdict({{680 * kMs, 700 * kMs}, {1500 * kMs, 1510 * kMs}}), Verdict::kInconclusive);
  const Score score = [&] {
    log.harness_late = {{680 * kMs, 700 * kMs}};
    return ScoreRun(ScenarioOf(log), log);
  }();
  EXPECT_EQ(score.reason,
            "survival: restarted at 0.800 s (reset by the firmware itself) directly after the harness itself "
            "was late: "
            "this machine was too busy to judge a firmware; 1 restart in all");
  // Another one, by itself.
  log.clients[0].restarts.push_back({1400 * kMs, "reset by the firmware itself"});
  EXPECT_EQ(verdict({{680 * kMs, 700 * kMs}}), Verdict::kFail);
  EXPECT_THAT(ScoreRun(ScenarioOf(log), log).reason, HasSubstr("restarted at 1.400 s"));
}

TEST(Disturbed, WhatFollowsSuchARestartIsNoProofEither) {
  RunLog log = StillFlight(151);
  log.clients[0].restarts = {{800 * kMs, "reset by the firmware itself"}};
  log.clients[0].starts_accepted_count = 2;
  log.harness_late = {{680 * kMs, 700 * kMs}};
  Scenario scenario = ScenarioOf(log);
  const std::size_t x = *log.trace.Find("x_m");
  const auto verdict = [&](EndReason end, std::size_t off_at_row) {
    log.end_reason = end;
    for (std::size_t row = 0; row < log.trace.row_count(); ++row)
      log.trace.mutable_row(row)[x] = row >= off_at_row ? 5 : 0;
    return ScoreRun(scenario, log).verdict;
  };
  scenario.criteria = {MineOn("firmware.restarts_count", {}, 0)};
  scenario.criteria.emplace_back().name = "near";
  scenario.criteria.back().stl = "always(x_m <= 1)";
  EXPECT_EQ(verdict(EndReason::kGroundStrike, 100), Verdict::kInconclusive);
  EXPECT_EQ(verdict(EndReason::kGroundStrike, 1000), Verdict::kInconclusive);
  EXPECT_EQ(verdict(EndReason::kCompleted, 30), Verdict::kFail);  // before it
  EXPECT_EQ(verdict(EndReason::kFirmwareCrashed, 100), Verdict::kFail);
  EXPECT_EQ(verdict(EndReason::kNodeLost, 100), Verdict::kError);
  scenario.allow_restarts = true;
  EXPECT_EQ(verdict(EndReason::kCompleted, 100), Verdict::kInconclusive);
  scenario.criteria.erase(scenario.criteria.begin());
  EXPECT_EQ(verdict(EndReason::kCompleted, 1000), Verdict::kPass);
}

}  // namespace
}  // namespace tiltproof::harness
