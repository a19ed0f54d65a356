// Effects of the firmware's restarts and requests on the verdict.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "harness/score/score.h"
#include "tests/harness/score/still_flight.h"
#include "tests/support/control_period.h"
#include "tests/support/tiltrotor_signals.h"

namespace tiltproof::harness {
namespace {

// A flight of `rows` rows that hangs still where it should, every input at hover.
faults::FaultSpec ResetAt(TimeNs start_ns) {
  faults::FaultSpec fault = Fault("reset", start_ns, kNever);
  fault.type = "device.reset";
  fault.parameters = {{"boot_ms", 20.0}};
  return fault;
}

faults::FaultSpec NodeFault(const std::string& type, const std::string& node, TimeNs start_ns) {
  faults::FaultSpec fault = Fault("node", start_ns, kNever);
  fault.type = type;
  fault.parameters = {{"node", node}, {"down_ms", 100.0}};
  return fault;
}

TEST(Score, ARestartThatNoFaultAskedForFailsSurvival) {
  RunLog log = StillFlight(101);
  log.clients[0].restarts = {{300 * kNsPerMs, "reset by watchdog"}, {700 * kNsPerMs, "reset by pin"}};
  Scenario scenario = ScenarioOf(log);
  const Score score = ScoreRun(scenario, log);
  EXPECT_EQ(score.verdict, Verdict::kFail);
  EXPECT_EQ(score.restarts, 2);
  EXPECT_EQ(
      score.reason,
      "survival: restarted at 0.300 s (reset by watchdog), which no fault asked for; 2 restarts in all");
  EXPECT_DOUBLE_EQ(score.criteria[0].time_s.value(), 0.3);
  scenario.allow_restarts = true;
  EXPECT_EQ(ScoreRun(scenario, log).verdict, Verdict::kPass);
  EXPECT_EQ(ScoreRun(scenario, log).restarts, 2);
}

TEST(Score, EachFaultAsksForOneRestartFromItsStartOn) {
  RunLog log = StillFlight(101);
  Scenario scenario = ScenarioOf(log);
  const auto survives = [&](const std::vector<faults::FaultSpec>& faults,
                            const std::vector<TimeNs>& restarts_ms) {
    scenario.faults = faults;
    log.fault_activation_counts.assign(faults.size(), 1);
    log.clients[0].restarts.clear();
    for (const TimeNs ms : restarts_ms) log.clients[0].restarts.push_back({ms * kNsPerMs, "reset"});
    return ScoreRun(scenario, log).verdict == Verdict::kPass;
  };
  const TimeNs half = 500 * kNsPerMs;
  EXPECT_TRUE(survives({ResetAt(half)}, {500}));
  EXPECT_TRUE(survives({ResetAt(half)}, {620}));  // a hang's comes with the watchdog
  EXPECT_TRUE(survives({ResetAt(half)}, {}));
  EXPECT_TRUE(survives({ResetAt(half)}, {460}));  // in real time, its time is not exact
  EXPECT_FALSE(survives({ResetAt(half)}, {449}));
  EXPECT_FALSE(survives({ResetAt(half)}, {460, 500}));
  EXPECT_FALSE(survives({ResetAt(half)}, {500, 800}));
  EXPECT_TRUE(survives({ResetAt(half), ResetAt(half)}, {500, 800}));
  EXPECT_FALSE(survives({ResetAt(half), ResetAt(900 * kNsPerMs)}, {500, 800}));
  EXPECT_TRUE(survives({NodeFault("node.restart", "client", half)}, {600}));
  EXPECT_FALSE(survives({NodeFault("node.restart", "base_station", half)}, {600}));
  EXPECT_FALSE(survives({Fault("noise", 0, kNever)}, {600}));
}

TEST(Score, ARestartComesBeforeTheEndThatItLedTo) {
  RunLog log = StillFlight(101);
  log.clients[0].restarts = {{300 * kNsPerMs, "reset by watchdog"}};
  log.end_reason = EndReason::kGroundStrike;
  log.end_text = "down";
  EXPECT_EQ(
      ScoreRun(ScenarioOf(log), log).reason,
      "survival: restarted at 0.300 s (reset by watchdog), which no fault asked for; 1 restart in all; then "
      "ground strike at 1.200 s: down");
  log.end_reason = EndReason::kHarnessError;
  EXPECT_EQ(ScoreRun(ScenarioOf(log), log).verdict, Verdict::kError);
}

// Requests as sent, `count` of them.
RunLog FlightThatAsksEvery(double period_ms, std::size_t count) {
  RunLog log = StillFlight(101);
  for (std::size_t i = 0; i < count; ++i)
    log.clients[0].sent_request_times_ns.push_back(FromSeconds(static_cast<double>(i) * period_ms / 1000));
  return log;
}

const CriterionResult* ControlPeriodOf(const Score& score) {
  for (const auto& criterion : score.criteria)
    if (criterion.name == "control_period") return &criterion;
  return nullptr;
}

TEST(Score, AWrongPeriodFailsControlPeriodWithBothFigures) {
  RunLog log = FlightThatAsksEvery(6, 51);
  Scenario scenario = ScenarioOf(log);
  const Score score = ScoreRun(scenario, log);
  EXPECT_EQ(score.verdict, Verdict::kFail);
  EXPECT_EQ(score.reason,
            "control_period: asks every 6.000 ms, the protocol requires 12 ms: is the core clock right?");
  EXPECT_EQ(score.criteria[1].name, "control_period");
  scenario.control_period_tolerance_percent = 50;
  EXPECT_EQ(ScoreRun(scenario, log).verdict, Verdict::kPass);
  const auto passes = [](double period_ms) {
    const RunLog flight = FlightThatAsksEvery(period_ms, 60);
    return ScoreRun(ScenarioOf(flight), flight).verdict == Verdict::kPass;
  };
  EXPECT_TRUE(passes(12));
  EXPECT_TRUE(passes(11.88));
  EXPECT_TRUE(passes(12.12));
  EXPECT_FALSE(passes(11.87));
  EXPECT_FALSE(passes(12.13));
}

// A clock makes all intervals wrong alike.
TEST(Score, MissingAndDoubledRequestsAreNotTheClocks) {
  const auto reason = [](double first_ms, double second_ms) {
    RunLog log = StillFlight(101);
    for (int i = 0; i < 60; ++i)
      log.clients[0].sent_request_times_ns.push_back(
          FromSeconds(i / 2 * (first_ms + second_ms) / 1000 + i % 2 * first_ms / 1000));
    return ScoreRun(ScenarioOf(log), log).reason;
  };
  EXPECT_EQ(
      reason(1, 11),
      "control_period: asks every 1.000 ms, the protocol requires 12 ms: requests are missing or doubled");
  EXPECT_EQ(
      reason(24, 36),
      "control_period: asks every 24.000 ms, the protocol requires 12 ms: requests are missing or doubled");
  EXPECT_EQ(reason(12.6, 12.5),
            "control_period: asks every 12.600 ms, the protocol requires 12 ms: is the core clock right?");
}

TEST(Score, FewerThan50IntervalsAreNotJudged) {
  const RunLog enough = FlightThatAsksEvery(6, 51), few = FlightThatAsksEvery(6, 50);
  EXPECT_NE(ControlPeriodOf(ScoreRun(ScenarioOf(enough), enough)), nullptr);
  EXPECT_EQ(ControlPeriodOf(ScoreRun(ScenarioOf(few), few)), nullptr);
  EXPECT_EQ(ScoreRun(ScenarioOf(few), few).verdict, Verdict::kPass);
}

// `lost_count` intervals in which an emulator lost a tick, evenly among those of `period_ms`. `told`: it was noticed.
RunLog FlightThatLosesTicks(double period_ms, std::size_t count, std::size_t lost_count, bool told) {
  RunLog log = StillFlight(101);
  TimeNs now_ns = 0;
  log.clients[0].sent_request_times_ns = {now_ns};
  for (std::size_t i = 0; i < count; ++i) {
    const bool lost = (i + 1) * lost_count / count != i * lost_count / count;
    const TimeNs begin_ns = now_ns;
    now_ns += FromSeconds(period_ms / 1000) + (lost ? kNsPerMs : 0);
    log.clients[0].sent_request_times_ns.push_back(now_ns);
    if (lost && told) log.board_disturbed.push_back({begin_ns + 5 * kNsPerMs, begin_ns + 6 * kNsPerMs});
  }
  return log;
}

Verdict VerdictOf(const RunLog& log) { return ScoreRun(ScenarioOf(log), log).verdict; }

TEST(Score, TicksThatTheMachineTookAreNotBlamedOnTheFirmware) {
  // By the median of all, half of the intervals or more are wrong.
  EXPECT_EQ(VerdictOf(FlightThatLosesTicks(12, 240, 180, false)), Verdict::kFail);
  EXPECT_EQ(VerdictOf(FlightThatLosesTicks(12, 240, 180, true)), Verdict::kPass);  // 60 tell
  const Score score = [] {
    const RunLog log = FlightThatLosesTicks(12, 240, 200, true);
    return ScoreRun(ScenarioOf(log), log);
  }();
  EXPECT_EQ(score.verdict, Verdict::kInconclusive);
  EXPECT_EQ(score.reason,
            "control_period: in 200 of 240 intervals this machine took time from the board: it was too busy "
            "to judge "
            "a firmware");
}

TEST(Score, LostTicksHideNoWrongPeriod) {
  for (const double period_ms : {11.0, 13.0}) {
    EXPECT_EQ(VerdictOf(FlightThatLosesTicks(period_ms, 240, 0, true)), Verdict::kFail);
    EXPECT_EQ(VerdictOf(FlightThatLosesTicks(period_ms, 240, 180, true)), Verdict::kFail);
    // Those of 11 ms are 12 ms now.
    EXPECT_EQ(VerdictOf(FlightThatLosesTicks(period_ms, 240, 230, true)), Verdict::kInconclusive);
  }
}

TEST(Score, AFewDisturbedIntervalsLeaveAShortFlightJudged) {
  EXPECT_EQ(VerdictOf(FlightThatLosesTicks(12, 60, 20, true)), Verdict::kPass);
  EXPECT_EQ(VerdictOf(FlightThatLosesTicks(13, 60, 20, true)), Verdict::kFail);
  EXPECT_EQ(VerdictOf(FlightThatLosesTicks(12, 60, 40, true)), Verdict::kInconclusive);
}

TEST(Score, IntervalsInFaultsOnTheClientDoNotCount) {
  // Wrong in the first 0.6 s, right for 0.72 s after it.
  RunLog log = FlightThatAsksEvery(6, 101);
  for (int i = 1; i <= 60; ++i)
    log.clients[0].sent_request_times_ns.push_back(600 * kNsPerMs + i * kControlPeriodNs);
  const auto judged = [&](const std::string& type, std::map<std::string, faults::ParameterValue> parameters) {
    Scenario scenario = ScenarioOf(log);
    scenario.faults = {Fault("f", 0, 600 * kNsPerMs)};
    scenario.faults[0].type = type;
    scenario.faults[0].parameters = std::move(parameters);
    log.fault_activation_counts = {1};
    return ControlPeriodOf(ScoreRun(scenario, log))->verdict;
  };
  EXPECT_EQ(judged("wire.bit_error", {{"ber", 1e-5}}), Verdict::kFail);
  EXPECT_EQ(judged("device.stall", {}), Verdict::kPass);
  EXPECT_EQ(judged("clock.drift", {{"ppm", 10'000.0}}), Verdict::kPass);
  EXPECT_EQ(judged("clock.drift", {{"node", "plant"}, {"ppm", 10'000.0}}), Verdict::kFail);
  EXPECT_EQ(judged("node.pause", {{"node", "client"}}), Verdict::kPass);
  EXPECT_EQ(judged("node.pause", {{"node", "plant"}}), Verdict::kFail);
}

}  // namespace
}  // namespace tiltproof::harness
