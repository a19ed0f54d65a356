// A harness that was late itself must not blame the firmware.
#include <gtest/gtest.h>

#include <optional>
#include <string>

#include "harness/score/score.h"
#include "tests/support/control_period.h"
#include "tests/support/tiltrotor_signals.h"

namespace tiltproof::harness {
namespace {

// A flight in real time, of which nothing is known but how late the harness was.
RunLog LateFlight(std::int64_t period_count, std::optional<std::int64_t> overrun_count, TimeNs late_max_ns) {
  RunLog log;
  log.trace = testing::TiltrotorTrace();
  log.hover_input = {0, 0, 0, 0};
  log.clients[0].starts_accepted_count = 1;
  log.end_ns = period_count * kControlPeriodNs;
  log.harness_overrun_count = overrun_count;
  log.harness_late_max_ns = late_max_ns;
  return log;
}

Score ScoreOf(const RunLog& log) {
  Scenario scenario;
  scenario.duration_ns = log.end_ns;
  return ScoreRun(scenario, log);
}

TEST(Lateness, IsAMetricInRealTimeAlone) {
  RunLog log = LateFlight(1000, 0, 1'250'000);
  log.clients[0].client_round_trip_ns = {900'000, 700'000, 800'000};
  const auto metrics = ScoreOf(log).metrics;
  EXPECT_EQ(metrics.at("timing.harness_overrun_count"), 0.0);
  EXPECT_EQ(metrics.at("timing.harness_late_max_ms"), 1.25);
  EXPECT_EQ(metrics.at("timing.client_round_trip_p50_ms"), 0.8);
  EXPECT_EQ(metrics.at("timing.client_round_trip_p99_ms"), 0.9);
  EXPECT_EQ(metrics.at("timing.client_round_trip_max_ms"), 0.9);
  log.harness_overrun_count.reset();
  log.harness_late_max_ns.reset();
  for (const auto& [name, value] : ScoreOf(log).metrics) EXPECT_EQ(name.find("harness_"), std::string::npos);
}

TEST(Lateness, TooOftenIsInconclusive) {
  const auto verdict = [](std::int64_t period_count, std::int64_t overrun_count) {
    return ScoreOf(LateFlight(period_count, overrun_count, 13 * kNsPerMs)).verdict;
  };
  EXPECT_EQ(verdict(1000, 0), Verdict::kPass);
  EXPECT_EQ(verdict(1000, 10), Verdict::kPass);
  EXPECT_EQ(verdict(1000, 11), Verdict::kInconclusive);
  // A short flight has its three.
  EXPECT_EQ(verdict(10, 3), Verdict::kPass);
  EXPECT_EQ(verdict(10, 4), Verdict::kInconclusive);
  EXPECT_EQ(verdict(0, 4), Verdict::kInconclusive);
}

// Lateness that the firmware's own processes caused excuses no failure, and shows no success.
TEST(Lateness, ByTheFirmwareItselfIsItsOwn) {
  RunLog log = LateFlight(1000, 0, 0);
  EXPECT_EQ(ScoreOf(log).verdict, Verdict::kPass);
  for (TimeNs i = 0; i < 100; ++i)
    log.firmware_late.push_back({i * kControlPeriodNs, i * kControlPeriodNs + 5 * kNsPerMs});
  log.firmware_use = {
      .run_ns = 1900 * kNsPerMs, .elapsed_ns = kNsPerS, .processors_count = 2, .processes_max = 9};
  const std::string own =
      "the firmware's own processes (9 at a time) used 1.9 s of the 2.0 s that 2 processors had, and made "
      "the "
      "harness late in 100 of 1000 periods (at most 5 ms)";
  EXPECT_EQ(ScoreOf(log).verdict, Verdict::kInconclusive);
  EXPECT_EQ(ScoreOf(log).reason, own + ": a firmware cannot be judged that leaves no processor to it");
  log.end_reason = EndReason::kGroundStrike;
  EXPECT_EQ(ScoreOf(log).verdict, Verdict::kFail);
  EXPECT_TRUE(ScoreOf(log).reason.ends_with("; " + own)) << ScoreOf(log).reason;
  // Others' load beside it, which is too much by itself.
  log.harness_overrun_count = 11;
  EXPECT_EQ(ScoreOf(log).verdict, Verdict::kInconclusive);
  // A little of it shows nothing.
  log.harness_overrun_count = 0;
  log.end_reason = EndReason::kCompleted;
  log.firmware_late.resize(3);
  EXPECT_EQ(ScoreOf(log).verdict, Verdict::kPass);
}

TEST(Lateness, OnceByMuchIsInconclusive) {
  const auto verdict = [](std::optional<std::int64_t> overrun_count, TimeNs late_max_ns) {
    return ScoreOf(LateFlight(1000, overrun_count, late_max_ns)).verdict;
  };
  EXPECT_EQ(verdict(1, 36 * kNsPerMs), Verdict::kPass);
  EXPECT_EQ(verdict(1, 36 * kNsPerMs + 1), Verdict::kInconclusive);
  // Never later than allowed: judged as ever.
  EXPECT_EQ(verdict(0, 40 * kNsPerMs), Verdict::kPass);
  EXPECT_EQ(verdict(std::nullopt, 40 * kNsPerMs), Verdict::kPass);
}

TEST(Lateness, SaysHowLateAndStillShowsWhatWasSeen) {
  RunLog log = LateFlight(1000, 50, 13'500'000);
  log.end_reason = EndReason::kDiverged;
  const Score score = ScoreOf(log);
  EXPECT_EQ(score.verdict, Verdict::kInconclusive);
  EXPECT_EQ(score.reason,
            "the harness itself was late in 50 of 1000 periods (at most 13.5 ms): this machine was too busy "
            "to judge a firmware");
  EXPECT_EQ(score.criteria.at(0).verdict, Verdict::kFail);
}

TEST(Lateness, ExcusesNoErrorAndNoFirmwareThatWentAway) {
  RunLog log = LateFlight(1000, 500, 100 * kNsPerMs);
  const auto verdict = [&](EndReason reason) {
    log.end_reason = reason;
    return ScoreOf(log).verdict;
  };
  EXPECT_EQ(verdict(EndReason::kFirmwareLost), Verdict::kFail);
  EXPECT_EQ(verdict(EndReason::kFirmwareCrashed), Verdict::kFail);
  EXPECT_EQ(verdict(EndReason::kFirmwareHung), Verdict::kFail);
  EXPECT_EQ(verdict(EndReason::kNodeLost), Verdict::kError);
  EXPECT_EQ(verdict(EndReason::kHarnessError), Verdict::kError);
}

TEST(Lateness, ExcusesAFirmwareThatNeverStartedOnlyWhenItTookMostOfItsTime) {
  RunLog log = LateFlight(0, 0, 0);
  log.end_reason = EndReason::kNeverStarted;
  log.end_ns = 0;
  // Times count to the end; a client has 10 s.
  log.harness_late = {{-10 * kNsPerS, -5100 * kNsPerMs}};
  EXPECT_EQ(ScoreOf(log).verdict, Verdict::kFail);
  log.harness_late = {{-10 * kNsPerS, -8 * kNsPerS}, {-9 * kNsPerS, -4900 * kNsPerMs}};
  const Score score = ScoreOf(log);
  EXPECT_EQ(score.verdict, Verdict::kInconclusive);
  EXPECT_EQ(score.reason,
            "the harness itself was late in 426 of the 833 periods in which it may start: this machine was "
            "too busy "
            "to judge a firmware");
}

// A period without actuators counts unless the harness was late in it or in the one before.
TEST(Lateness, ExcusesMissedPeriods) {
  const auto missed = [](const std::vector<LateSpan>& late, TimeNs end_ns = 20 * kControlPeriodNs) {
    RunLog log = LateFlight(20, 0, 0);
    log.end_ns = end_ns;
    log.harness_late = late;
    for (TimeNs period = 0; period < 20; ++period)
      if (period != 5 && period != 6 && period != 14 && period * kControlPeriodNs < end_ns)
        log.clients[0].actuator_times_ns.push_back(period * kControlPeriodNs + 2 * kNsPerMs);
    return ScoreOf(log).metrics.at("timing.firmware_missed_count");
  };
  const auto in_period = [](TimeNs period) {
    return LateSpan{period * kControlPeriodNs + 3 * kNsPerMs, period * kControlPeriodNs + 8 * kNsPerMs};
  };
  EXPECT_EQ(missed({}), 3);
  EXPECT_EQ(missed({in_period(14)}), 2);
  EXPECT_EQ(missed({in_period(13)}), 2);
  EXPECT_EQ(missed({in_period(5), in_period(14)}), 0);
  EXPECT_EQ(missed({in_period(6)}), 2);
  // One span over all of them.
  EXPECT_EQ(missed({{5 * kControlPeriodNs, 15 * kControlPeriodNs}}), 0);
  // Late where nothing was missed excuses nothing.
  EXPECT_EQ(missed({in_period(1), in_period(9), in_period(18)}), 3);
  // Nor is what comes after the end missed.
  EXPECT_EQ(missed({}, 14 * kControlPeriodNs), 2);
}

}  // namespace
}  // namespace tiltproof::harness
