// Metrics by hand, and how criteria, faults and the flight's end become one verdict.
#include "harness/score/score.h"
#include "tests/harness/score/still_flight.h"
#include "tests/support/control_period.h"
#include "tests/support/tiltrotor_signals.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace tiltproof::harness {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Key;
using ::testing::Not;

std::map<std::string, double> MetricsOf(const Scenario& scenario, const RunLog& log) {
  return ComputeMetrics(scenario, log).values;
}

TEST(Metrics, EveryNameGivenIsListedAndNoneTwice) {
  RunLog log = StillFlight(1000);
  log.clients[0].failsafe_entered_count = 0;
  log.clients[0].receive_overruns_count = 0;
  log.clients[0].deadline_missed_count = 0;
  log.clients[0].stacks = {{"main", 100, 10, false}};
  log.clients[0].request_times_ns = {0, 12, 24};
  log.clients[0].reply_latency_ns = {1};
  log.clients[0].client_round_trip_ns = {1};
  log.clients[0].protocol = ProtocolUse{
      .refused_commands = 0, .replies_ignored = CountedMistake(), .commands_without_reply = CountedMistake()};
  log.harness_overrun_count = 0;
  log.harness_late_max_ns = 0;
  Scenario scenario = ScenarioOf(log);
  scenario.faults.push_back(Fault("a", kNsPerS, 2 * kNsPerS));
  auto names = MetricNamesOf(scenario, MetricNames());
  for (const auto& [name, value] : MetricsOf(scenario, log)) EXPECT_THAT(names, Contains(name));
  EXPECT_EQ(MetricsOf(scenario, log).size(), names.size());
  std::sort(names.begin(), names.end());
  EXPECT_EQ(std::adjacent_find(names.begin(), names.end()), names.end());
}

TEST(Metrics, TheFullestStackCounts) {
  RunLog log = StillFlight(4);
  EXPECT_THAT(MetricsOf(ScenarioOf(log), log), Not(Contains(Key("firmware.stack_used_share_max"))));
  log.clients[0].stacks = {
      {"main", 4096, 1024, false}, {"control_stack", 512, 384, false}, {"idle", 64, 0, false}};
  EXPECT_EQ(MetricsOf(ScenarioOf(log), log).at("firmware.stack_used_share_max"), 0.75);
}

TEST(Metrics, TrackingByHand) {
  RunLog log = StillFlight(4);
  Set(log, 1, "x_m", 3.0);
  Set(log, 1, "y_ref_m", 4.0);  // error 5
  Set(log, 2, "z_m", -1.0);     // error 1
  auto metrics = MetricsOf(ScenarioOf(log), log);
  EXPECT_DOUBLE_EQ(metrics.at("tracking.rmse_m"), std::sqrt(26.0 / 4));
  EXPECT_DOUBLE_EQ(metrics.at("tracking.rmse_x_m"), 1.5);
  EXPECT_DOUBLE_EQ(metrics.at("tracking.rmse_y_m"), 2.0);
  EXPECT_DOUBLE_EQ(metrics.at("tracking.rmse_z_m"), 0.5);
  EXPECT_EQ(metrics.at("tracking.max_error_m"), 5.0);
  EXPECT_DOUBLE_EQ(metrics.at("tracking.iae_m_s"), 0.012 * 6);
  EXPECT_DOUBLE_EQ(metrics.at("tracking.itae_m_s2"), 0.012 * (0.012 * 5 + 0.024 * 1));
  EXPECT_THAT(metrics, Not(Contains(Key("tracking.rmse_after_10s_m"))));
  // From the onset at 12 ms on, only the third row counts, 12 ms after it.
  Scenario scenario = ScenarioOf(log);
  scenario.faults = {Fault("late", 20 * kNsPerMs, kNever), Fault("early", 12 * kNsPerMs, kNever)};
  EXPECT_DOUBLE_EQ(MetricsOf(scenario, log).at("tracking.itae_m_s2"), 0.012 * 0.012);
  Set(log, 0, "x_m", 1.0);  // what was before the onset weighs nothing
  EXPECT_DOUBLE_EQ(MetricsOf(scenario, log).at("tracking.itae_m_s2"), 0.012 * 0.012);
  scenario.faults = {Fault("always", kPowerOn, kNever)};
  EXPECT_EQ(MetricsOf(scenario, log).at("tracking.itae_m_s2"), metrics.at("tracking.itae_m_s2"));
}

TEST(Metrics, TheFirstTenSecondsCanBeLeftOut) {
  RunLog log = StillFlight(836);  // row 834 is the first at or after 10 s
  Set(log, 833, "x_m", 100.0);
  Set(log, 835, "x_m", 2.0);
  EXPECT_DOUBLE_EQ(MetricsOf(ScenarioOf(log), log).at("tracking.rmse_after_10s_m"), std::sqrt(2.0));
}

TEST(Metrics, RowsThatAreNotFiniteAreLeftOut) {
  RunLog log = StillFlight(3);
  Set(log, 0, "x_m", 2.0);
  Set(log, 2, "x_m", kNan);
  Set(log, 2, "roll_rad", kNan);
  Set(log, 1, "roll_rad", -0.25);
  const auto metrics = MetricsOf(ScenarioOf(log), log);
  EXPECT_DOUBLE_EQ(metrics.at("tracking.rmse_m"), std::sqrt(2.0));
  EXPECT_DOUBLE_EQ(metrics.at("tracking.iae_m_s"), 0.012);
  EXPECT_EQ(metrics.at("attitude.max_roll_rad"), 0.25);
}

TEST(Metrics, SettlingIsFromTheLastFaultsEndUntilTheErrorStaysSmall) {
  RunLog log = StillFlight(101);
  Scenario scenario = ScenarioOf(log);
  scenario.faults = {Fault("a", 0, 100 * kNsPerMs), Fault("b", 0, 120 * kNsPerMs)};
  EXPECT_EQ(MetricsOf(scenario, log).at("tracking.settling_s"), 0.0);
  Set(log, 9, "x_m", 1.0);  // before the end
  EXPECT_EQ(MetricsOf(scenario, log).at("tracking.settling_s"), 0.0);
  scenario.faults[1].end_ns = 125 * kNsPerMs;  // off the grid: the row before is in force
  EXPECT_EQ(MetricsOf(scenario, log).at("tracking.settling_s"), 0.0);
  scenario.faults[1].end_ns = 120 * kNsPerMs;
  Set(log, 20, "x_m", 0.2501);
  EXPECT_DOUBLE_EQ(MetricsOf(scenario, log).at("tracking.settling_s"), 0.252 - 0.120);
  Set(log, 40, "x_m", -0.25);
  EXPECT_DOUBLE_EQ(MetricsOf(scenario, log).at("tracking.settling_s"), 0.252 - 0.120);
  Set(log, 100, "x_m", 0.3);
  const Metrics never = ComputeMetrics(scenario, log);
  EXPECT_THAT(never.values, Not(Contains(Key("tracking.settling_s"))));
  EXPECT_DOUBLE_EQ(never.settling_at_least_s.value(), 1.2 - 0.12);
  scenario.faults.push_back(Fault("c", 0, kNever));
  EXPECT_THAT(MetricsOf(scenario, log), Not(Contains(Key("tracking.settling_s"))));
  EXPECT_EQ(ComputeMetrics(scenario, log).settling_at_least_s, std::nullopt);
  EXPECT_THAT(MetricsOf(ScenarioOf(log), log), Not(Contains(Key("tracking.settling_s"))));
}

TEST(Metrics, SettlingAfterARestartIsFromTheNewStart) {
  RunLog log = StillFlight(101);
  Set(log, 20, "x_m", 1.0);
  Scenario scenario = ScenarioOf(log);
  scenario.faults = {Fault("reboot", 60 * kNsPerMs, kNever)};
  scenario.faults[0].type = "node.restart";
  scenario.faults[0].parameters = {{"node", "client"}, {"down_ms", 60.0}};
  EXPECT_DOUBLE_EQ(MetricsOf(scenario, log).at("tracking.settling_s"), 0.252 - 0.120);
}

TEST(Metrics, ControlByHand) {
  RunLog log = StillFlight(5);
  Set(log, 1, "f_r_n", 30.0);
  Set(log, 2, "tau_l_nm", -2.0);
  Set(log, 2, "f_r_n", 0.0);
  Set(log, 4, "tau_r_nm", 1.0);  // the last row's input has no time to act
  auto metrics = MetricsOf(ScenarioOf(log), log);
  EXPECT_DOUBLE_EQ(metrics.at("control.saturation_ratio"), 2.0 / 5);
  EXPECT_DOUBLE_EQ(metrics.at("control.effort"), 0.012 * (400 + 4 + 100));
  log.input_min = log.input_max = {};
  EXPECT_THAT(MetricsOf(ScenarioOf(log), log), Not(Contains(Key("control.saturation_ratio"))));
}

TEST(Metrics, QuantilesAreByNearestRank) {
  const std::vector<double> ten = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10};
  EXPECT_EQ(NearestRank(ten, 50, 100), 5.0);
  EXPECT_EQ(NearestRank(ten, 51, 100), 6.0);
  EXPECT_EQ(NearestRank(ten, 99, 100), 10.0);
  EXPECT_EQ(NearestRank(ten, 1, 100), 1.0);
  EXPECT_EQ(NearestRank({7.0}, 999, 1000), 7.0);
  RunLog log = StillFlight(2);
  log.clients[0].reply_latency_ns = {3'000'000, 1'000'000, 2'500'000};
  log.clients[0].request_times_ns = {0, 12'000'000, 25'000'000, 36'000'000};
  const auto metrics = MetricsOf(ScenarioOf(log), log);
  EXPECT_EQ(metrics.at("timing.reply_latency_p50_ms"), 2.5);
  EXPECT_EQ(metrics.at("timing.reply_latency_p99_ms"), 3.0);
  EXPECT_EQ(metrics.at("timing.request_period_mean_ms"), 12.0);
  EXPECT_EQ(metrics.at("timing.request_period_p50_ms"), 12.0);
  EXPECT_EQ(metrics.at("timing.request_period_p999_ms"), 13.0);
  log.clients[0].request_times_ns = {0};
  EXPECT_THAT(MetricsOf(ScenarioOf(log), log), Not(Contains(Key("timing.request_period_max_ms"))));
}

TEST(Metrics, JitterIsTheDistanceFromTheControlPeriod) {
  RunLog log = StillFlight(2);
  log.clients[0].request_times_ns = {0, 12'000'000, 25'000'000, 35'500'000};
  const auto metrics = MetricsOf(ScenarioOf(log), log);
  EXPECT_EQ(metrics.at("timing.request_jitter_p50_ms"), 1.0);
  EXPECT_EQ(metrics.at("timing.request_jitter_p99_ms"), 1.5);
  EXPECT_EQ(metrics.at("timing.request_jitter_p999_ms"), 1.5);
  EXPECT_EQ(metrics.at("timing.request_jitter_max_ms"), 1.5);
}

TEST(Metrics, MissedPeriodsAreGapsBetweenActuatorMessages) {
  const auto missed = [](const std::vector<double>& arrivals_ms) {
    RunLog log = StillFlight(11);  // 120 ms
    for (const double ms : arrivals_ms) log.clients[0].actuator_times_ns.push_back(FromSeconds(ms / 1000));
    return MetricsOf(ScenarioOf(log), log).at("timing.firmware_missed_count");
  };
  EXPECT_EQ(missed({6, 18, 30, 42, 54, 66, 78, 90, 102, 114}), 0.0);
  EXPECT_EQ(missed({6, 18.3, 30, 42, 54, 54.2, 66, 77.1, 90, 102, 114}), 0.0);  // jitter, a duplicate
  EXPECT_EQ(missed({6, 18, 42, 54, 66, 102, 114}), 3.0);
  EXPECT_EQ(missed({30, 42, 54, 66, 78}), 5.0);
  EXPECT_EQ(missed({}), 10.0);
  RunLog never = StillFlight(11);
  never.clients[0].starts_accepted_count = 0;
  EXPECT_THAT(MetricsOf(ScenarioOf(never), never), Not(Contains(Key("timing.firmware_missed_count"))));
}

TEST(Metrics, CountsAreTakenOver) {
  RunLog log = StillFlight(11);
  log.clients[0].counts[static_cast<std::size_t>(link::Direction::kToClient)] = {10, 7, 3, 5};
  log.clients[0].accepted_wrong_count = 2;
  log.clients[0].accepted_stale_count = 4;
  log.clients[0].resync_max_ns = 1'500'000;
  log.clients[0].starts_accepted_count = 3;
  auto metrics = MetricsOf(ScenarioOf(log), log);
  EXPECT_EQ(metrics.at("link.to_client.frames_sent_count"), 10.0);
  EXPECT_EQ(metrics.at("link.to_client.frames_accepted_count"), 7.0);
  EXPECT_EQ(metrics.at("link.to_client.frames_rejected_count"), 3.0);
  EXPECT_EQ(metrics.at("link.to_client.bytes_corrupted_count"), 5.0);
  EXPECT_EQ(metrics.at("link.to_plant.frames_sent_count"), 0.0);
  EXPECT_EQ(metrics.at("link.accepted_wrong_count"), 2.0);
  EXPECT_EQ(metrics.at("link.accepted_stale_count"), 4.0);
  EXPECT_EQ(metrics.at("link.resync_max_ms"), 1.5);
  EXPECT_EQ(metrics.at("firmware.restarts_count"), 2.0);
  EXPECT_DOUBLE_EQ(metrics.at("survival.time_s"), 0.12);
  EXPECT_THAT(metrics, Not(Contains(Key("firmware.failsafe_entered_count"))));
  EXPECT_THAT(metrics, Not(Contains(Key("protocol.malformed_sent_count")))) << "a log of an older program";
  log.clients[0].protocol = ProtocolUse{.requests_per_period_max = 2,
                                        .actuators_per_request_max = 4,
                                        .actuators_before_reply = 8,
                                        .replies_unanswered = 16,
                                        .malformed_sent = 32,
                                        .refused_commands = 64,
                                        .replies_ignored = CountedMistake{.count = 128},
                                        .commands_without_reply = CountedMistake{.count = 256}};
  metrics = MetricsOf(ScenarioOf(log), log);
  EXPECT_EQ(metrics.at("protocol.requests_per_period_max_count"), 2.0);
  EXPECT_EQ(metrics.at("protocol.actuators_per_request_max_count"), 4.0);
  EXPECT_EQ(metrics.at("protocol.actuators_before_reply_count"), 8.0);
  EXPECT_EQ(metrics.at("protocol.replies_unanswered_count"), 16.0);
  EXPECT_EQ(metrics.at("protocol.malformed_sent_count"), 32.0);
  EXPECT_EQ(metrics.at("protocol.refused_commands_count"), 64.0);
  EXPECT_EQ(metrics.at("protocol.replies_ignored_count"), 128.0);
  EXPECT_EQ(metrics.at("protocol.commands_without_reply_count"), 256.0);
  log.clients[0].protocol = ProtocolUse();
  metrics = MetricsOf(ScenarioOf(log), log);
  for (const char* name : {"refused_commands_count", "replies_ignored_count", "commands_without_reply_count"})
    EXPECT_THAT(metrics, Not(Contains(Key(std::string("protocol.") + name)))) << "a log of an older program";
  log.clients[0].failsafe_entered_count = 6;
  EXPECT_EQ(MetricsOf(ScenarioOf(log), log).at("firmware.failsafe_entered_count"), 6.0);
}

CriterionSpec Stl(const std::string& name, const std::string& formula) {
  CriterionSpec spec;
  spec.name = name;
  spec.stl = formula;
  return spec;
}
CriterionSpec Metric(const std::string& metric, std::optional<double> min, std::optional<double> max) {
  CriterionSpec spec;
  spec.name = metric;
  spec.metric = metric;
  spec.min = min;
  spec.max = max;
  return spec;
}

TEST(Score, AFlightThatMeetsItsCriteriaPasses) {
  RunLog log = StillFlight(101);
  Set(log, 50, "x_m", 0.5);
  Scenario scenario = ScenarioOf(log);
  scenario.criteria = {Stl("near", "always\n  (position_error_m <= 1)"),
                       Metric("tracking.max_error_m", 0.1, 2.0)};
  const Score score = ScoreRun(scenario, log);
  EXPECT_EQ(score.verdict, Verdict::kPass);
  EXPECT_EQ(score.reason, "");
  ASSERT_EQ(score.criteria.size(), 3u);
  EXPECT_EQ(score.criteria[0].name, "survival");
  EXPECT_EQ(score.criteria[0].verdict, Verdict::kPass);
  EXPECT_EQ(score.criteria[0].explanation, "flew to the end at 1.200 s");
  EXPECT_EQ(score.criteria[1].robustness, 0.5);
  EXPECT_DOUBLE_EQ(score.criteria[1].time_s.value(), 0.6);
  EXPECT_EQ(score.criteria[1].explanation,
            "always (position_error_m <= 1): position_error_m = 0.5 at 0.600 s");
  EXPECT_EQ(score.criteria[2].robustness, 0.4);
  EXPECT_EQ(score.criteria[2].explanation, "tracking.max_error_m = 0.5, min 0.1, max 2");
  EXPECT_EQ(score.metrics.at("tracking.max_error_m"), 0.5);
}

TEST(Score, OnlyOneCriterionIsJudgedAsAmongOthers) {
  RunLog log = StillFlight(101);
  Set(log, 50, "x_m", 0.5);
  Scenario scenario = ScenarioOf(log);
  scenario.criteria = {Stl("near", "always(position_error_m <= 0.25)"),
                       Metric("tracking.max_error_m", 0.1, 0.25)};
  const Score all = ScoreRun(scenario, log);
  for (const std::size_t one : {1U, 2U}) {
    const Score score = ScoreRun(scenario, log, {.only = all.criteria[one].name});
    ASSERT_EQ(score.criteria.size(), 2u);
    EXPECT_EQ(score.criteria[1].explanation, all.criteria[one].explanation);
    EXPECT_EQ(score.criteria[1].verdict, Verdict::kFail);
    EXPECT_EQ(score.metrics.empty(), one == 1);
  }
}

TEST(Score, ABrokenCriterionSaysWhichWhenAndByHowMuch) {
  RunLog log = StillFlight(101);
  Set(log, 50, "x_m", 1.42);
  Set(log, 51, "x_m", 3.0);
  Set(log, 20, "roll_rad", 0.8);
  Scenario scenario = ScenarioOf(log);
  scenario.criteria = {Metric("tracking.max_error_m", std::nullopt, 2.0),
                       Stl("near", "always(position_error_m <= 1)"),
                       Stl("upright", "always(abs(roll_rad) <= 0.6)")};
  const Score score = ScoreRun(scenario, log);
  EXPECT_EQ(score.verdict, Verdict::kFail);
  EXPECT_EQ(score.criteria[1].robustness, -1.0);
  EXPECT_EQ(score.criteria[2].robustness, -2.0);
  EXPECT_EQ(score.criteria[2].explanation,
            "always(position_error_m <= 1): position_error_m = 1.42 at 0.600 s");
  // The reason names the criterion that was the first to fail.
  EXPECT_EQ(score.reason, "upright: always(abs(roll_rad) <= 0.6): roll_rad = 0.8 at 0.240 s");
}

TEST(Score, BoundsAreInclusive) {
  const RunLog log = StillFlight(11);
  Scenario scenario = ScenarioOf(log);
  scenario.criteria = {Metric("tracking.max_error_m", 0.0, 0.0)};
  EXPECT_EQ(ScoreRun(scenario, log).verdict, Verdict::kPass);
  scenario.criteria = {Metric("tracking.max_error_m", 1e-9, std::nullopt)};
  EXPECT_EQ(ScoreRun(scenario, log).verdict, Verdict::kFail);
}

struct End {
  EndReason reason;
  Verdict verdict;
  std::string explanation;
};

class ScoreEnd : public ::testing::TestWithParam<End> {};

TEST_P(ScoreEnd, DecidesSurvival) {
  RunLog log = StillFlight(11);
  Scenario scenario = ScenarioOf(log);
  scenario.duration_ns = kNsPerS;
  log.end_reason = GetParam().reason;
  log.end_text = "as it\nhappened";
  const Score score = ScoreRun(scenario, log);
  EXPECT_EQ(score.verdict, GetParam().verdict);
  EXPECT_EQ(score.criteria[0].verdict, GetParam().verdict);
  EXPECT_EQ(score.criteria[0].explanation, GetParam().explanation);
  EXPECT_EQ(score.reason, "survival: " + GetParam().explanation);
  EXPECT_DOUBLE_EQ(score.criteria[0].time_s.value(), 0.12);
}

INSTANTIATE_TEST_SUITE_P(
    All, ScoreEnd,
    ::testing::Values(
        End{EndReason::kDiverged, Verdict::kFail, "diverged at 0.120 s: as it happened"},
        End{EndReason::kGroundStrike, Verdict::kFail, "ground strike at 0.120 s: as it happened"},
        End{EndReason::kNeverStarted, Verdict::kFail, "never started at 0.120 s: as it happened"},
        End{EndReason::kFirmwareHung, Verdict::kFail, "firmware hung at 0.120 s: as it happened"},
        End{EndReason::kFirmwareCrashed, Verdict::kFail, "firmware crashed at 0.120 s: as it happened"},
        End{EndReason::kFirmwareLost, Verdict::kFail, "firmware lost at 0.120 s: as it happened"},
        End{EndReason::kNodeLost, Verdict::kError,
            "a node of the harness was lost at 0.120 s: as it happened"},
        End{EndReason::kInterrupted, Verdict::kInconclusive, "interrupted at 0.120 s: as it happened"},
        End{EndReason::kHarnessError, Verdict::kError, "harness error at 0.120 s: as it happened"}));

TEST(Score, AnUndecidedWindowIsInconclusive) {
  RunLog log = StillFlight(11);
  Scenario scenario = ScenarioOf(log);
  scenario.criteria = {Stl("long", "always[0,0.5](position_error_m <= 1)")};
  const Score past_end = ScoreRun(scenario, log);
  EXPECT_EQ(past_end.verdict, Verdict::kInconclusive);
  EXPECT_EQ(past_end.reason,
            "long: always[0,0.5](position_error_m <= 1): undecided, a window reaches past the end at 0.120 "
            "s; so far "
            "position_error_m = 0 at 0.000 s");
  scenario.duration_ns = kNsPerS;
  log.end_reason = EndReason::kInterrupted;
  scenario.criteria = {Stl("on", "always(position_error_m <= 1)")};
  const Score cut = ScoreRun(scenario, log);
  EXPECT_THAT(cut.criteria[1].explanation, HasSubstr("undecided, the flight ended at 0.120 s of 1 s"));
}

TEST(Score, AFlightNeedNotEndOnARow) {
  RunLog log = StillFlight(11);
  log.end_ns = 124 * kNsPerMs;
  Scenario scenario = ScenarioOf(log);
  scenario.criteria = {Stl("near", "always(position_error_m <= 1)"),
                       Stl("all", "always[0,0.124](tilt_rad <= 1)")};
  EXPECT_EQ(ScoreRun(scenario, log).verdict, Verdict::kPass);
}

TEST(Score, AFaultThatNeverActsIsInconclusiveUnlessTheRunFailed) {
  RunLog log = StillFlight(11);
  Scenario scenario = ScenarioOf(log);
  scenario.faults = {Fault("acts", 0, kNever), Fault("idle", 0, kNever)};
  log.fault_activation_counts = {3, 0};
  const Score score = ScoreRun(scenario, log);
  EXPECT_EQ(score.verdict, Verdict::kInconclusive);
  EXPECT_EQ(score.reason, "fault 'idle' never activated");
  ASSERT_EQ(score.faults.size(), 2u);
  EXPECT_EQ(score.faults[0].activations, 3);
  EXPECT_EQ(score.faults[1].id, "idle");
  scenario.criteria = {Metric("tracking.max_error_m", 1.0, std::nullopt)};
  EXPECT_EQ(ScoreRun(scenario, log).verdict, Verdict::kFail);
  log.fault_activation_counts = {3, 1};
  scenario.criteria.clear();
  EXPECT_EQ(ScoreRun(scenario, log).verdict, Verdict::kPass);
}

TEST(Score, AnAbsentMetricIsInconclusiveAndAnUnknownOneAnError) {
  const RunLog log = StillFlight(11);
  Scenario scenario = ScenarioOf(log);
  scenario.criteria = {Metric("firmware.failsafe_entered_count", std::nullopt, 0.0)};
  const Score absent = ScoreRun(scenario, log);
  EXPECT_EQ(absent.verdict, Verdict::kInconclusive);
  EXPECT_EQ(absent.criteria[1].explanation,
            "firmware.failsafe_entered_count is not available in this flight, max 0");
  scenario.criteria = {Metric("firmware.failsafe", std::nullopt, 0.0)};
  EXPECT_EQ(ScoreRun(scenario, log).verdict, Verdict::kError);
}

TEST(Score, AnErrorThatNeverSettledIsWorseThanABoundThatPassed) {
  RunLog log = StillFlight(101);
  Set(log, 100, "x_m", 1.0);
  Scenario scenario = ScenarioOf(log);
  scenario.faults = {Fault("a", 0, 200 * kNsPerMs)};
  log.fault_activation_counts = {1};
  scenario.criteria = {Metric("tracking.settling_s", std::nullopt, 0.5)};
  const Score failed = ScoreRun(scenario, log);
  EXPECT_EQ(failed.verdict, Verdict::kFail);
  EXPECT_DOUBLE_EQ(failed.criteria[1].robustness.value(), -0.5);
  scenario.criteria = {Metric("tracking.settling_s", std::nullopt, 5.0)};
  EXPECT_EQ(ScoreRun(scenario, log).verdict, Verdict::kInconclusive);
}

TEST(Score, MetricsOfAFlightThatWasCutShortDecideNothing) {
  RunLog log = StillFlight(11);
  Scenario scenario = ScenarioOf(log);
  scenario.duration_ns = kNsPerS;
  scenario.criteria = {Metric("survival.time_s", 1.0, std::nullopt)};
  log.end_reason = EndReason::kInterrupted;
  EXPECT_EQ(ScoreRun(scenario, log).verdict, Verdict::kInconclusive);
  log.end_reason = EndReason::kDiverged;
  EXPECT_EQ(ScoreRun(scenario, log).criteria[1].verdict, Verdict::kFail);
}

TEST(Score, ErrorOutranksFail) {
  RunLog log = StillFlight(11);
  Scenario scenario = ScenarioOf(log);
  scenario.criteria = {Stl("fails", "always(x_m > 1)"), Stl("broken", "always(x_mm > 1)")};
  const Score score = ScoreRun(scenario, log);
  EXPECT_EQ(score.criteria[1].verdict, Verdict::kFail);
  EXPECT_EQ(score.verdict, Verdict::kError);
  EXPECT_EQ(score.reason,
            "broken: always(x_mm > 1): column 8: unknown signal 'x_mm'; did you mean 'x_m'? all signals: "
            "tiltproof list "
            "--signals");
}

TEST(Score, ATraceWithoutItsColumnsIsAnErrorNotACrash) {
  RunLog log = StillFlight(0);
  log.trace = Trace({"t_s"});
  log.trace.AppendRow()[0] = 0.0;
  Scenario scenario;
  scenario.criteria = {Stl("near", "always(x_m <= 1)"), Metric("tracking.rmse_m", std::nullopt, 1.0)};
  const Score score = ScoreRun(scenario, log);
  EXPECT_EQ(score.verdict, Verdict::kError);
  EXPECT_THAT(score.reason, HasSubstr("the trace has no column"));
}

TEST(Score, AnEmptyTraceIsScored) {
  RunLog log;
  log.trace = testing::TiltrotorTrace();
  log.end_reason = EndReason::kNeverStarted;
  Scenario scenario;
  scenario.duration_ns = kNsPerS;
  scenario.criteria = {Stl("near", "always(x_m <= 1)"), Metric("tracking.rmse_m", std::nullopt, 1.0)};
  const Score score = ScoreRun(scenario, log);
  EXPECT_EQ(score.verdict, Verdict::kFail);
  EXPECT_EQ(score.criteria[1].verdict, Verdict::kInconclusive);
  EXPECT_EQ(score.criteria[2].verdict, Verdict::kInconclusive);
  EXPECT_EQ(score.metrics.at("survival.time_s"), 0.0);
}

TEST(Score, FormulasMayNameFaults) {
  RunLog log = StillFlight(3);
  Trace trace([&] {
    auto columns = log.trace.columns();
    columns.push_back("active_gust");
    return columns;
  }());
  for (std::size_t r = 0; r < 3; ++r) {
    const auto row = trace.AppendRow();
    std::copy(log.trace.row(r).begin(), log.trace.row(r).end(), row.begin());
    row.back() = r == 1 ? 1.0 : 0.0;
  }
  log.trace = std::move(trace);
  log.fault_activation_counts = {1};
  Scenario scenario = ScenarioOf(log);
  scenario.faults = {Fault("gust", 0, kNever)};
  scenario.criteria = {Stl("calm", "always(not fault_active(\"gust\"))")};
  const Score score = ScoreRun(scenario, log);
  EXPECT_EQ(score.verdict, Verdict::kFail);
  EXPECT_EQ(score.reason,
            "calm: always(not fault_active(\"gust\")): fault_active(\"gust\") is true at 0.012 s");
}

}  // namespace
}  // namespace tiltproof::harness
