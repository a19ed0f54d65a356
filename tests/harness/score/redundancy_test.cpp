// Flights of several clients, from logs put together by hand.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "harness/score/outcome.h"
#include "harness/score/score.h"
#include "tests/harness/score/still_flight.h"
#include "tests/support/control_period.h"

namespace tiltproof::harness {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Key;
using ::testing::Not;

struct RedundantFlight {
  Scenario scenario;
  RunLog log;
  Score score() const { return ScoreRun(scenario, log); }
  CriterionResult criterion(const std::string& name) const {
    for (const CriterionResult& criterion : score().criteria)
      if (criterion.name == name) return criterion;
    return {};
  }
};

// 10 s with the clients a and b, sound until `b_silent_ns`.
RedundantFlight Two(TimeNs b_silent_ns = kNever) {
  RedundantFlight flown;
  flown.log = StillFlight(834);
  flown.log.clients.resize(2);
  for (std::size_t client = 0; client < 2; ++client) {
    ClientLog& own = flown.log.clients[client];
    own.id = client == 0 ? "a" : "b";
    flown.scenario.clients.push_back({.id = own.id, .firmware = ""});
    own.starts_accepted_count = 1;
    own.line_mistakes.emplace();
    const TimeNs until_ns = client == 1 ? b_silent_ns : kNever;
    for (TimeNs t = kControlPeriodNs; t <= flown.log.end_ns; t += kControlPeriodNs) {
      if (t >= until_ns) {
        own.line_mistakes->push_back({t, LineMistakeKind::kMissing});
        continue;
      }
      own.sent_request_times_ns.push_back(t);
      own.actuator_times_ns.push_back(t);
    }
  }
  flown.scenario.duration_ns = flown.log.end_ns;
  flown.scenario.arbiter.type = ArbiterType::kPrimaryBackup;
  flown.log.redundancy = {.switches_count = 2, .without_control_ns = kNsPerS, .largest_bump = 0.25};
  return flown;
}

TEST(Redundancy, MetricsAreTheTotalsAndHaveNamesOnlyWithSeveralClients) {
  RedundantFlight flown = Two();
  flown.log.redundancy->split_brain_ns = 2 * kNsPerS;
  flown.log.redundancy->disagreement_ns = 3 * kNsPerS;
  flown.log.clients[1].loss = {.time_ns = 4 * kNsPerS};
  const auto metrics = flown.score().metrics;
  const auto names = MetricNamesOf(flown.scenario, MetricNames());
  for (const auto& [name, value] : metrics) EXPECT_THAT(names, Contains(name));
  EXPECT_EQ(metrics.at("redundancy.switches_count"), 2);
  EXPECT_EQ(metrics.at("redundancy.without_control_s"), 1);
  EXPECT_EQ(metrics.at("redundancy.largest_bump"), 0.25);
  EXPECT_EQ(metrics.at("redundancy.split_brain_s"), 2);
  EXPECT_EQ(metrics.at("redundancy.disagreement_s"), 3);
  EXPECT_EQ(metrics.at("redundancy.clients_lost_count"), 1);
  EXPECT_EQ(metrics.at("firmware.b.lost_at_s"), 4);
  EXPECT_THAT(metrics, Not(Contains(Key("firmware.a.lost_at_s"))));
  flown.scenario.clients.pop_back();
  EXPECT_THAT(MetricNamesOf(flown.scenario, MetricNames()), Not(Contains("redundancy.switches_count")));
  EXPECT_THAT(MetricNamesOf(flown.scenario, MetricNames()), Not(Contains("firmware.lost_at_s")));
}

TEST(Redundancy, ALostClientIsNamedAndTheOthersAreJudged) {
  constexpr TimeNs kLost = 4 * kNsPerS;
  RedundantFlight flown = Two(kLost);
  EXPECT_EQ(flown.criterion("clean_line").verdict, Verdict::kFail) << "it is silent, and not lost";
  flown.log.clients[1].loss = {.time_ns = kLost, .hung = true, .text = "did not return", .end = {}};
  EXPECT_EQ(flown.criterion("clean_line").verdict, Verdict::kPass);
  EXPECT_EQ(flown.criterion("survival").verdict, Verdict::kPass);
  EXPECT_THAT(flown.criterion("survival").explanation,
              HasSubstr(", without client b (hung at 4.000 s: did not return)"));
  EXPECT_EQ(OutcomeOf(flown.log, flown.score()), Outcome::kDetected);
  flown.scenario.criteria.push_back(
      {.name = "all-alive", .stl = "", .metric = "redundancy.clients_lost_count", .min = {}, .max = 0});
  EXPECT_EQ(flown.criterion("all-alive").verdict, Verdict::kFail);
}

// Where an arbiter chooses, one silent client is no hung firmware; two are.
TEST(Redundancy, TheFirmwareHangsWhenAllAreSilent) {
  RedundantFlight flown = Two(4 * kNsPerS);
  flown.log.redundancy->switches_count = 0;
  Score score = flown.score();
  score.verdict = Verdict::kPass;
  EXPECT_EQ(OutcomeOf(flown.log, score), Outcome::kUnaffected);
  flown.log.clients[0].sent_request_times_ns = {kNsPerS};
  EXPECT_EQ(OutcomeOf(flown.log, score), Outcome::kHung);
}

TEST(Redundancy, AStandbyNeedNotCommand) {
  RedundantFlight flown = Two();
  for (int i = 0; i < 5; ++i)
    flown.log.clients[1].line_mistakes->push_back(
        {(i + 100) * kControlPeriodNs, LineMistakeKind::kUnanswered});
  for (const double role : {0.0, 1.0, std::nan("")}) {
    RedundantFlight told = flown;
    told.log.trace.AppendColumn("role_b", std::vector<double>(told.log.trace.row_count(), role));
    EXPECT_EQ(told.criterion("clean_line").verdict, role == 0 ? Verdict::kPass : Verdict::kFail) << role;
  }
}

}  // namespace
}  // namespace tiltproof::harness
