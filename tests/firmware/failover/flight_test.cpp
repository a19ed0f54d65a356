// Two and three boards of the shipped firmware on the shipped vehicle, with lines between them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "harness/client/library_client.h"
#include "harness/run/client_parameters.h"
#include "harness/run/flight.h"
#include "tests/harness/run/by_hand.h"

namespace tiltproof::harness {
namespace {

faults::FaultSpec Reset(const std::string& client, TimeNs at, double boot_ms) {
  faults::FaultSpec fault;
  fault.id = "reset-" + client + std::to_string(at / kNsPerMs);
  fault.type = "device.reset";
  fault.client = client;
  fault.start_ns = at;
  fault.parameters = {{"boot_ms", boot_ms}};
  return fault;
}

faults::FaultSpec OnCross(const std::string& type, TimeNs start, TimeNs end,
                          std::map<std::string, faults::ParameterValue> parameters = {}) {
  faults::FaultSpec fault;
  fault.id = type;
  fault.type = type;
  fault.line = "cross";
  fault.target = faults::Target::kBoth;
  fault.start_ns = start;
  fault.end_ns = end;
  fault.parameters = std::move(parameters);
  return fault;
}

Scenario Boards(const std::string& firmware, std::vector<faults::FaultSpec> faults) {
  Scenario scenario;
  scenario.name = "boards";
  scenario.firmware = firmware;
  scenario.duration_ns = 8 * kNsPerS;
  scenario.reference.path = SpiralReference{};
  scenario.initial_position_m = {2, 0, 0.5};
  scenario.clients = {{"a", ""}, {"b", ""}};
  if (firmware == "triplex") {
    scenario.clients.push_back({"c", ""});
    scenario.arbiter.type = ArbiterType::kMidValue;
    scenario.lines = {{"ab", {"a", "b"}, 921'600, nullptr},
                      {"ac", {"a", "c"}, 921'600, nullptr},
                      {"bc", {"b", "c"}, 921'600, nullptr}};
  } else {
    scenario.arbiter.type = ArbiterType::kActiveClaims;
    scenario.lines = {{"cross", {"a", "b"}, 921'600, nullptr}};
  }
  scenario.arbiter.timeout_ms = 36;
  scenario.faults = std::move(faults);
  return scenario;
}

RunLog Fly(const Scenario& scenario) {
  return Fly(scenario, Model(), {.make_client = [&](std::size_t client, ClientHost host) {
               return LoadLibraryClient(TILTPROOF_FIRMWARE_LIBRARY, scenario.firmware, "paper",
                                        std::move(host), nullptr, false,
                                        [&, client] { return ClientParameters(scenario, Model(), client); });
             }});
}

double At(const RunLog& log, const char* column, double t_s) {
  const std::size_t time = *log.trace.Find("t_s"), wanted = *log.trace.Find(column);
  for (std::size_t row = 0; row < log.trace.row_count(); ++row)
    if (log.trace.at(row, time) >= t_s) return log.trace.at(row, wanted);
  return NAN;
}
double LargestError(const RunLog& log, double from_s) {
  const std::size_t time = *log.trace.Find("t_s");
  double largest = 0;
  for (std::size_t row = 0; row < log.trace.row_count(); ++row) {
    if (log.trace.at(row, time) < from_s) continue;
    double squares = 0;
    for (const auto& [is, wanted] : {std::pair{"x_m", "x_ref_m"}, {"y_m", "y_ref_m"}, {"z_m", "z_ref_m"}}) {
      const double error =
          log.trace.at(row, *log.trace.Find(is)) - log.trace.at(row, *log.trace.Find(wanted));
      squares += error * error;
    }
    largest = std::max(largest, std::sqrt(squares));
  }
  return largest;
}

constexpr double kBumpMax = 0.01;  // of an input's range

TEST(FailoverFlight, OneBoardClaimsFromTheBeginning) {
  const RunLog log = Fly(Boards("failover", {}));
  ASSERT_EQ(log.end_reason, EndReason::kCompleted) << log.end_text;
  EXPECT_EQ(At(log, "role_a", 1), 1);
  EXPECT_EQ(At(log, "role_b", 1), 0);
  EXPECT_EQ(log.redundancy->switches_count, 0);
  EXPECT_EQ(log.redundancy->split_brain_ns, 0);
  EXPECT_LE(log.redundancy->without_control_ns, 24 * kNsPerMs);
}

TEST(FailoverFlight, ADeathIsOneSwitchWithoutABump) {
  const RunLog log = Fly(Boards("failover", {Reset("a", 4 * kNsPerS, 60'000)}));
  ASSERT_EQ(log.end_reason, EndReason::kCompleted) << log.end_text;
  EXPECT_EQ(log.redundancy->switches_count, 1);
  EXPECT_LT(log.redundancy->largest_bump, kBumpMax);
  EXPECT_LE(log.redundancy->without_control_ns, 48 * kNsPerMs);
  EXPECT_EQ(At(log, "role_b", 4.1), 1);
  EXPECT_LT(LargestError(log, 4), 0.5);
}

TEST(FailoverFlight, ABoardThatWasResetFliesOnWithTheIntegralsOfTheOther) {
  const RunLog log = Fly(Boards("failover", {Reset("a", 3 * kNsPerS, 500), Reset("b", 5 * kNsPerS, 60'000)}));
  ASSERT_EQ(log.end_reason, EndReason::kCompleted) << log.end_text;
  EXPECT_EQ(log.redundancy->switches_count, 2);
  EXPECT_LT(log.redundancy->largest_bump, kBumpMax);
  EXPECT_EQ(At(log, "role_a", 4.5), 0);
  EXPECT_EQ(At(log, "role_a", 5.1), 1);
  EXPECT_LT(LargestError(log, 4), 0.5);
}

// Twelve phases of a control period of 12 ms.
std::vector<double> Phases_ms() {
  std::vector<double> phases_ms;
  for (int i = 0; i < 12; ++i) phases_ms.push_back(i + 0.5);
  return phases_ms;
}

// The periods of both boards begin at any time between two references. In most phases the first command of board a is
// that of a vehicle at rest, because it has heard the other board but no reference yet. That command does not act.
TEST(FailoverFlight, ABoardThatWasResetFliesOnWheneverItsPeriodsBegin) {
  for (const double phase_ms : Phases_ms()) {
    // Board b begins its periods at the same time. At 1.1 s the reference is 8 ms old.
    const double boot_b_ms = 100 + std::fmod(phase_ms + 4, 12);
    Scenario scenario =
        Boards("failover", {Reset("b", kNsPerS, boot_b_ms), Reset("a", 4 * kNsPerS, 500 + phase_ms),
                            Reset("b", 7500 * kNsPerMs, 60'000)});
    scenario.duration_ns = 10 * kNsPerS;
    const RunLog log = Fly(scenario);
    EXPECT_EQ(log.end_reason, EndReason::kCompleted) << phase_ms << log.end_text;
    EXPECT_EQ(log.redundancy->switches_count, 2) << phase_ms;
    EXPECT_LT(log.redundancy->largest_bump, kBumpMax) << phase_ms;
    EXPECT_LT(LargestError(log, 4), 0.5) << phase_ms;
  }
}

// A board that is alone does not know that its first commands do not act, and computes them without integrals.
TEST(TolerantPairFlight, ABoardThatWasResetFliesOnWheneverItsPeriodsBegin) {
  for (const double phase_ms : Phases_ms()) {
    Scenario scenario = Boards("tolerant", {Reset("a", 2 * kNsPerS, 500 + phase_ms)});
    scenario.lines.clear();
    scenario.arbiter = {.type = ArbiterType::kPrimaryBackup, .timeout_ms = 36, .return_ms = 100};
    scenario.duration_ns = 5500 * kNsPerMs;
    const RunLog log = Fly(scenario);
    EXPECT_EQ(log.end_reason, EndReason::kCompleted) << phase_ms << log.end_text;
    EXPECT_EQ(log.redundancy->switches_count, 2) << phase_ms;
    EXPECT_LT(LargestError(log, 4), 0.5) << phase_ms;
  }
}

// The board is back before it is missed, but without its integrals.
TEST(FailoverFlight, AShortResetIsASwitchToTheBoardThatHasTheIntegrals) {
  for (const double boot_ms : {0.0, 5.0, 10.0, 20.0, 30.0}) {
    const RunLog log = Fly(Boards("failover", {Reset("a", 4 * kNsPerS, boot_ms)}));
    ASSERT_EQ(log.end_reason, EndReason::kCompleted) << boot_ms << log.end_text;
    EXPECT_EQ(log.redundancy->switches_count, 1) << boot_ms;
    EXPECT_LT(log.redundancy->largest_bump, kBumpMax) << boot_ms;
    EXPECT_LT(LargestError(log, 4), 0.5) << boot_ms;
  }
}

TEST(FailoverFlight, TheSecondClaimEndsWhenTheLineIsBack) {
  const RunLog log = Fly(Boards("failover", {OnCross("link.silence", 3 * kNsPerS, 5 * kNsPerS)}));
  ASSERT_EQ(log.end_reason, EndReason::kCompleted) << log.end_text;
  EXPECT_EQ(log.redundancy->switches_count, 0);
  EXPECT_EQ(At(log, "role_b", 3.1), 1);
  EXPECT_EQ(At(log, "role_a", 5.2), 1);
  EXPECT_EQ(At(log, "role_b", 5.2), 0);
  EXPECT_GT(*log.redundancy->split_brain_ns, 1900 * kNsPerMs);
  EXPECT_LE(*log.redundancy->split_brain_ns, 2200 * kNsPerMs);
  EXPECT_LE(log.redundancy->without_control_ns, 24 * kNsPerMs);
}

TEST(FailoverFlight, ALateLineOnlyDelaysTheSwitch) {
  const RunLog log =
      Fly(Boards("failover", {OnCross("frame.delay", 2 * kNsPerS, 8 * kNsPerS, {{"mean_ms", 30.0}}),
                              Reset("a", 4 * kNsPerS, 60'000)}));
  ASSERT_EQ(log.end_reason, EndReason::kCompleted) << log.end_text;
  EXPECT_EQ(log.redundancy->switches_count, 1);
  EXPECT_LT(log.redundancy->largest_bump, kBumpMax);
  EXPECT_LE(log.redundancy->without_control_ns, 84 * kNsPerMs);
}

TEST(TriplexFlight, ABoardThatWasResetIsAsGoodAsTheOthers) {
  const RunLog log = Fly(Boards("triplex", {Reset("c", 3 * kNsPerS, 300), Reset("a", 5 * kNsPerS, 60'000),
                                            Reset("b", 6 * kNsPerS, 60'000)}));
  ASSERT_EQ(log.end_reason, EndReason::kCompleted) << log.end_text;
  EXPECT_EQ(log.redundancy->without_control_ns, 0);
  EXPECT_LT(log.redundancy->largest_bump, kBumpMax);
  EXPECT_EQ(At(log, "arbiter_selected", 7), 2);
  EXPECT_LT(LargestError(log, 4), 0.5);
}

}  // namespace
}  // namespace tiltproof::harness
