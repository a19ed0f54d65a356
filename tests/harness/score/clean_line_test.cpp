// Verdicts on a client's mistakes on its line, from logs put together by hand.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "harness/score/outcome.h"
#include "harness/score/score.h"
#include "tests/harness/score/still_flight.h"
#include "tests/support/control_period.h"

namespace tiltproof::harness {
namespace {

using ::testing::HasSubstr;

constexpr TimeNs kPeriod = kControlPeriodNs;

// 10 s.
RunLog CleanFlight() {
  RunLog log = StillFlight(834);
  for (TimeNs t = kPeriod; t <= log.end_ns; t += kPeriod) {
    log.clients[0].sent_request_times_ns.push_back(t);
    log.clients[0].actuator_times_ns.push_back(t);
  }
  log.clients[0].line_mistakes.emplace();
  return log;
}

RunLog FlightWith(std::vector<LineMistake> mistakes) {
  RunLog log = CleanFlight();
  log.clients[0].line_mistakes = std::move(mistakes);
  return log;
}

// So many, from 1 s on, each a period after the one before.
std::vector<LineMistake> Many(LineMistakeKind kind, std::int64_t count) {
  std::vector<LineMistake> mistakes;
  for (std::int64_t i = 0; i < count; ++i) mistakes.push_back({kNsPerS + i * kPeriod, kind});
  return mistakes;
}

CriterionResult CleanLineOf(const RunLog& log, const Scenario& scenario) {
  for (const CriterionResult& criterion : ScoreRun(scenario, log).criteria)
    if (criterion.name == "clean_line") return criterion;
  CriterionResult absent;
  absent.name = "absent";
  return absent;
}
CriterionResult CleanLineOf(const RunLog& log) { return CleanLineOf(log, ScenarioOf(log)); }
Verdict VerdictUnder(const RunLog& log, const faults::FaultSpec& fault) {
  Scenario scenario = ScenarioOf(log);
  scenario.faults = {fault};
  return CleanLineOf(log, scenario).verdict;
}

constexpr LineMistakeKind kOtherKinds[] = {LineMistakeKind::kMissing, LineMistakeKind::kDoubled,
                                           LineMistakeKind::kUnanswered};

TEST(CleanLine, OneMalformedFrameOrTwoPeriodsFail) {
  EXPECT_EQ(CleanLineOf(CleanFlight()).verdict, Verdict::kPass);
  EXPECT_EQ(CleanLineOf(FlightWith({{kNsPerS, LineMistakeKind::kMalformed}})).verdict, Verdict::kFail);
  for (const auto kind : kOtherKinds) {
    EXPECT_EQ(CleanLineOf(FlightWith({{kNsPerS, kind}})).verdict, Verdict::kPass);
    EXPECT_EQ(CleanLineOf(FlightWith({{kNsPerS, kind}, {5 * kNsPerS, kind}})).verdict, Verdict::kFail);
  }
  EXPECT_EQ(CleanLineOf(FlightWith({{kNsPerS, LineMistakeKind::kMissing, 2}})).verdict, Verdict::kFail);
  // One of each kind.
  EXPECT_EQ(CleanLineOf(FlightWith({{kNsPerS, LineMistakeKind::kMissing},
                                    {kNsPerS, LineMistakeKind::kDoubled},
                                    {kNsPerS, LineMistakeKind::kUnanswered}}))
                .verdict,
            Verdict::kPass);
}

TEST(CleanLine, AScenarioMayAcceptMoreOrFewer) {
  const auto verdict = [](std::int64_t periods_count, LineMistakeKind kind, std::int64_t count) {
    const RunLog log = FlightWith(Many(kind, count));
    Scenario scenario = ScenarioOf(log);
    scenario.clean_line_periods_count = periods_count;
    return CleanLineOf(log, scenario).verdict;
  };
  EXPECT_EQ(verdict(5, LineMistakeKind::kMissing, 5), Verdict::kPass);
  EXPECT_EQ(verdict(5, LineMistakeKind::kMissing, 6), Verdict::kFail);
  EXPECT_EQ(verdict(0, LineMistakeKind::kMissing, 1), Verdict::kFail);
  EXPECT_EQ(verdict(1, LineMistakeKind::kMalformed, 1), Verdict::kFail);
  EXPECT_EQ(verdict(2, LineMistakeKind::kMalformed, 2), Verdict::kPass);
  EXPECT_EQ(verdict(2, LineMistakeKind::kMalformed, 3), Verdict::kFail);
}

TEST(CleanLine, FaultsExcuseUntilTwoSecondsAfterTheirEnd) {
  const auto verdict = [](faults::FaultSpec fault, const std::string& type, double time_s) {
    fault.type = type;
    if (type == "node.pause") fault.parameters = {{"node", "client"}};
    return VerdictUnder(FlightWith({{FromSeconds(time_s), LineMistakeKind::kMissing, 2}}), fault);
  };
  const faults::FaultSpec fault = Fault("f", 2 * kNsPerS, 4 * kNsPerS);
  for (const std::string type : {"wire.bit_error", "frame.drop", "link.silence", "uart.overrun",
                                 "sensor.freeze", "clock.drift", "node.pause"}) {
    EXPECT_EQ(verdict(fault, type, 1.9), Verdict::kFail) << type;
    EXPECT_EQ(verdict(fault, type, 2.0), Verdict::kPass) << type;
    EXPECT_EQ(verdict(fault, type, 5.9), Verdict::kPass) << type;
    EXPECT_EQ(verdict(fault, type, 6.1), Verdict::kFail) << type;
  }
  for (const std::string type : {"actuator.hard_over", "plant.mass", "harness.null"})
    EXPECT_EQ(verdict(fault, type, 3), Verdict::kFail) << type;
  // One of another client's does not.
  faults::FaultSpec others = fault;
  others.client = "b";
  EXPECT_EQ(verdict(others, "wire.bit_error", 3), Verdict::kFail);
}

TEST(CleanLine, AFaultThatComesAndGoesExcusesOnlyWhileItActs) {
  faults::FaultSpec fault = Fault("f", 0, kNever);
  fault.period_ns = 5 * kNsPerS;
  fault.duty = 0.2;
  const auto verdict = [&](double time_s) {
    return VerdictUnder(FlightWith({{FromSeconds(time_s), LineMistakeKind::kMissing, 2}}), fault);
  };
  EXPECT_EQ(verdict(2.9), Verdict::kPass);
  EXPECT_EQ(verdict(3.1), Verdict::kFail);
  EXPECT_EQ(verdict(5.1), Verdict::kPass);
  EXPECT_EQ(verdict(8.5), Verdict::kFail);
}

TEST(CleanLine, AResetExcusesUntilItsBootEnds) {
  faults::FaultSpec reset = Fault("reset", 2 * kNsPerS, kNever);
  reset.type = "device.reset";
  reset.parameters = {{"boot_ms", 1000.0}};
  const auto verdict = [&](double time_s, std::vector<Restart> restarts = {}) {
    RunLog log = FlightWith({{FromSeconds(time_s), LineMistakeKind::kMissing, 2}});
    log.clients[0].restarts = std::move(restarts);
    if (!log.clients[0].restarts.empty())
      std::erase_if(log.clients[0].sent_request_times_ns,
                    [](TimeNs t) { return t > 2 * kNsPerS && t < 9 * kNsPerS; });
    return VerdictUnder(log, reset);
  };
  EXPECT_EQ(verdict(4.9), Verdict::kPass);
  EXPECT_EQ(verdict(5.1), Verdict::kFail);
  EXPECT_EQ(verdict(8.9, {{2 * kNsPerS, "reset by pin"}}), Verdict::kPass);
  EXPECT_EQ(verdict(9.1, {{2 * kNsPerS, "reset by pin"}}), Verdict::kFail);
}

// A firmware that needs most of a period for its answer cannot give it once it is reset.
TEST(CleanLine, AnAnswerThatAFaultCutsOffIsNoMistake) {
  const auto verdict = [](TimeNs before_ns) {
    RunLog log = FlightWith({{4 * kNsPerS - before_ns, LineMistakeKind::kUnanswered},
                             {8 * kNsPerS - before_ns, LineMistakeKind::kUnanswered}});
    for (const TimeNs time_ns : {4 * kNsPerS, 8 * kNsPerS})
      log.clients[0].restarts.push_back({time_ns, "reset by pin"});
    return CleanLineOf(log).verdict;
  };
  EXPECT_EQ(verdict(kPeriod / 2), Verdict::kPass);
  EXPECT_EQ(verdict(kPeriod), Verdict::kPass);
  EXPECT_EQ(verdict(kPeriod + 1), Verdict::kFail);
  faults::FaultSpec silence = Fault("f", 4 * kNsPerS, 5 * kNsPerS);
  silence.type = "link.silence";
  const std::vector<LineMistake> late = {{4 * kNsPerS - kPeriod / 2, LineMistakeKind::kUnanswered},
                                         {4 * kNsPerS - kPeriod / 4, LineMistakeKind::kUnanswered}};
  EXPECT_EQ(VerdictUnder(FlightWith(late), silence), Verdict::kPass);
}

TEST(CleanLine, SaysWhatWhenAndHowOften) {
  const RunLog log =
      FlightWith({{2 * kNsPerS, LineMistakeKind::kMalformed, 1, "bad_checksum, bytes 7e 01 ab"},
                  {3 * kNsPerS, LineMistakeKind::kMissing, 7},
                  {4 * kNsPerS, LineMistakeKind::kUnanswered},
                  {4 * kNsPerS + kPeriod, LineMistakeKind::kUnanswered}});
  const CriterionResult result = CleanLineOf(log);
  EXPECT_EQ(
      result.explanation,
      "1 malformed frame, the first at 2.000 s (bad_checksum, bytes 7e 01 ab); 7 of 832 periods without "
      "a request, the first at 3.000 s; 2 of 832 periods without an actuator message, the first at 4.000 s");
  EXPECT_DOUBLE_EQ(result.time_s.value(), 2.0);
  EXPECT_EQ(CleanLineOf(CleanFlight()).explanation, "nothing missing, doubled or malformed");
}

TEST(CleanLine, AFirmwareThatStopsAnsweringIsNamed) {
  RunLog log = CleanFlight();
  std::erase_if(log.clients[0].actuator_times_ns, [](TimeNs t) { return t >= 5 * kNsPerS; });
  for (TimeNs t = 5 * kNsPerS; t < 6 * kNsPerS; t += kPeriod)
    log.clients[0].line_mistakes->push_back({t, LineMistakeKind::kUnanswered});
  log.end_reason = EndReason::kGroundStrike;
  log.end_ns = 6 * kNsPerS;
  const Score score = ScoreRun(ScenarioOf(log), log);
  EXPECT_EQ(score.reason, "clean_line: answered none of 84 good replies since 5.00 s");
}

TEST(CleanLine, NoCommandInTheWholeFlightFailsAlways) {
  RunLog log = CleanFlight();
  log.clients[0].actuator_times_ns.clear();
  Scenario scenario = ScenarioOf(log);
  scenario.faults = {Fault("f", 0, kNever)};
  scenario.clean_line_periods_count = 1'000'000;
  const Score score = ScoreRun(scenario, log);
  EXPECT_EQ(score.verdict, Verdict::kFail);
  EXPECT_EQ(score.reason, "clean_line: no actuator message was accepted in the whole flight");
  EXPECT_EQ(OutcomeOf(log, score), Outcome::kFailed);
}

TEST(CleanLine, WhatNobodyCanJudgeIsNotListed) {
  RunLog log = FlightWith({{kNsPerS, LineMistakeKind::kMalformed}});
  for (const EndReason ended : {EndReason::kNeverStarted, EndReason::kInterrupted, EndReason::kNodeLost,
                                EndReason::kHarnessError, EndReason::kLineOverfull}) {
    log.end_reason = ended;
    EXPECT_EQ(CleanLineOf(log).name, "absent") << Name(ended);
  }
  log.end_reason = EndReason::kFirmwareCrashed;
  EXPECT_EQ(CleanLineOf(log).verdict, Verdict::kFail);
  log.clients[0].line_mistakes.reset();
  EXPECT_EQ(CleanLineOf(log).name, "absent") << "of an older program";
}

TEST(CleanLine, OfSeveralClientsEachIsJudged) {
  RunLog log = CleanFlight();
  log.clients.push_back(log.clients[0]);
  log.clients[1].line_mistakes = {{kNsPerS, LineMistakeKind::kMalformed, 1, "bad_length"}};
  Scenario scenario = ScenarioOf(log);
  scenario.clients = {{"a", ""}, {"b", ""}};
  EXPECT_EQ(CleanLineOf(log, scenario).explanation,
            "client b 1 malformed frame, the first at 1.000 s (bad_length)");
}

TEST(CleanLine, RealTimeAcceptsThreePercent) {
  const auto verdict = [](std::int64_t count, LineMistakeKind kind) {
    RunLog log = FlightWith(Many(kind, count));
    log.harness_overrun_count = 0;
    return CleanLineOf(log).verdict;
  };
  for (const auto kind :
       {LineMistakeKind::kMalformed, LineMistakeKind::kMissing, LineMistakeKind::kDoubled}) {
    EXPECT_EQ(verdict(24, kind), Verdict::kPass);
    EXPECT_EQ(verdict(25, kind), Verdict::kFail);
  }
}

TEST(CleanLine, WhatThisMachineTookIsNotTheFirmwares) {
  RunLog log = FlightWith({{kNsPerS, LineMistakeKind::kMissing, 50}});
  log.harness_overrun_count = 1;
  EXPECT_EQ(CleanLineOf(log).verdict, Verdict::kFail);
  log.board_disturbed = {{kNsPerS, kNsPerS + 500 * kNsPerMs}};
  EXPECT_EQ(CleanLineOf(log).verdict, Verdict::kPass);
  log.board_disturbed.clear();
  log.harness_late = {{kNsPerS, kNsPerS + 500 * kNsPerMs}};
  EXPECT_EQ(CleanLineOf(log).verdict, Verdict::kPass);
  // Bytes that waited for t = 0 come together, in the first period.
  RunLog waited = FlightWith(std::vector<LineMistake>(50, {0, LineMistakeKind::kDoubled}));
  waited.harness_overrun_count = 0;
  EXPECT_EQ(CleanLineOf(waited).verdict, Verdict::kFail);
  waited.harness_late = {{-kNsPerS, -1}};
  EXPECT_EQ(CleanLineOf(waited).verdict, Verdict::kPass);
  // When little is left, it says nothing.
  log.board_disturbed = {{2 * kNsPerS, 9 * kNsPerS}};
  log.harness_late.clear();
  const CriterionResult result = CleanLineOf(log);
  EXPECT_EQ(result.verdict, Verdict::kInconclusive);
  EXPECT_THAT(result.explanation, HasSubstr("it was too busy to judge a firmware"));
}

// A file of others may say anything.
TEST(CleanLine, NumbersWithoutSenseEndSoon) {
  const RunLog log = FlightWith({{-kNever, LineMistakeKind::kMissing, 1'000'000'000'000'000'000},
                                 {0, LineMistakeKind::kMissing, 1'000'000'000'000'000'000}});
  EXPECT_THAT(CleanLineOf(log).explanation, ::testing::StartsWith("834 of 832 periods without a request"));
  const std::vector<LineMistake> many(100'000, {0, LineMistakeKind::kMissing, 1'000'000'000'000'000'000});
  EXPECT_EQ(CleanLineOf(FlightWith(many)).explanation, CleanLineOf(log).explanation);
}

}  // namespace
}  // namespace tiltproof::harness
