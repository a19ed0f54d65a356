#include "harness/campaign/fault_level.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <string>

#include "tests/harness/campaign/tilt_rotor.h"

namespace tiltproof::harness {
namespace {

using faults::Scale;
using ::testing::HasSubstr;
using Parameters = std::map<std::string, faults::ParameterValue>;

Scenario With(const std::string& type, Parameters parameters) {
  Scenario scenario;
  scenario.duration_ns = 40 * kNsPerS;
  faults::FaultSpec fault;
  fault.id = "probe";
  fault.type = type;
  fault.start_ns = 10 * kNsPerS;
  fault.parameters = std::move(parameters);
  scenario.faults = {fault};
  return scenario;
}

Severity Of(const Scenario& scenario, const SeverityChoice& choice = {}) {
  return SeverityOf(scenario, 0, TiltRotorSignals(), choice);
}

std::string Mistake(const Scenario& scenario, const SeverityChoice& choice = {}) {
  try {
    Of(scenario, choice);
  } catch (const SeverityMistake& mistake) {
    return mistake.what();
  }
  return "";
}

TEST(FaultLevel, IsTheTypesSeverity) {
  const Scenario scenario = With("sensor.drift", {{"signal", "z_m"}, {"rate_per_s", 0.018}});
  const Severity severity = Of(scenario);
  EXPECT_EQ(severity.parameter, "rate_per_s");
  EXPECT_EQ(severity.unit, "m/s");
  EXPECT_EQ(severity.range.start, 0.0);
  EXPECT_EQ(severity.range.end, 1e6);
  EXPECT_EQ(severity.range.scale, Scale::kLinear);
  const Scenario harder = AtLevel(scenario, 0, severity, 0.05);
  EXPECT_EQ(std::get<double>(harder.faults[0].parameters.at("rate_per_s")), 0.05);
}

TEST(FaultLevel, GoesToTheSideOfTheScenariosOwnValue) {
  const auto side = [](double own, const SeverityChoice& choice = {}) {
    const LevelRange range = Of(With("sensor.bias", {{"signal", "z_m"}, {"offset", own}}), choice).range;
    return std::pair(range.start, range.end);
  };
  EXPECT_EQ(side(0.5), std::pair(0.0, 1e6));
  EXPECT_EQ(side(-0.5), std::pair(0.0, -1e6));
  EXPECT_EQ(side(0.5, {.low = -2.0}), std::pair(0.0, -2.0));
  EXPECT_EQ(side(-0.5, {.high = 3.0}), std::pair(0.0, 3.0));
  EXPECT_EQ(side(0.5, {.low = -3.0, .high = -1.0}), std::pair(-1.0, -3.0));
  const Scenario both = With("sensor.bias", {{"signal", "z_m"}, {"offset", 0.5}});
  EXPECT_THAT(Mistake(both, {.low = -1.0, .high = 1.0}),
              HasSubstr("0 is harmless and lies between -1 and 1"));
  EXPECT_THAT(Mistake(both, {.low = 1.0, .high = 1.0}), HasSubstr("1 is not less than 1"));
  EXPECT_THAT(Mistake(both, {.high = 1e7}), HasSubstr("allowed is"));
}

TEST(FaultLevel, WalksDownFromAHarmlessValueAbove) {
  const LevelRange weak =
      Of(With("actuator.loss_of_effectiveness", {{"actuator", "f_r"}, {"factor", 0.5}})).range;
  EXPECT_EQ(std::pair(weak.start, weak.end), std::pair(1.0, 0.0));
  const Severity slow = Of(With("actuator.rate_limit", {{"actuator", "f_r"}, {"rate_per_s", 1.0}}));
  EXPECT_EQ(std::pair(slow.range.start, slow.range.end), std::pair(1e6, 0.0));
  EXPECT_EQ(slow.range.scale, Scale::kLogarithmic);
  EXPECT_EQ(slow.unit, "N/s");
  const LevelRange half = Of(With("sensor.scale", {{"signal", "z_m"}, {"factor", 0.5}})).range;
  EXPECT_EQ(std::pair(half.start, half.end), std::pair(1.0, 0.001));
}

TEST(FaultLevel, IsTheLengthOfTheWindowWhereNoParameterMeasuresIt) {
  Scenario scenario = With("sensor.freeze", {{"signal", "z_m"}});
  const Severity severity = Of(scenario);
  EXPECT_EQ(severity.parameter, kWindowParameter);
  EXPECT_EQ(severity.unit, "s");
  EXPECT_EQ(severity.range.start, 0.004);
  EXPECT_EQ(severity.range.end, 30.0);
  EXPECT_EQ(AtLevel(scenario, 0, severity, 2.5).faults[0].end_ns, FromSeconds(12.5));
  scenario.faults[0].start_ns = kPowerOn;
  EXPECT_THAT(Mistake(scenario), HasSubstr("needs a start_s"));
}

TEST(FaultLevel, IsTheLengthThatAParameterSets) {
  const Severity severity = Of(With("device.reset", {{"boot_ms", 20.0}}));
  EXPECT_EQ(severity.parameter, "boot_ms");
  EXPECT_EQ(severity.range.end, 30'000.0) << "the rest of the flight";
}

TEST(FaultLevel, AnInstantHasNone) {
  EXPECT_THAT(Mistake(With("device.hang", {})), HasSubstr("happens at one instant"));
  EXPECT_THAT(Mistake(With("device.bit_flip", {{"region", "ram"}, {"bit_count", 1.0}})),
              HasSubstr("happens at one instant"));
}

TEST(FaultLevel, IsAnotherNumberWhereTheUserAsks) {
  const Scenario scenario = With("frame.reorder", {{"probability", 0.3}, {"depth_count", 2.0}});
  const Severity severity = Of(scenario, {.parameter = "depth_count", .low = 1.0, .high = 16.0});
  EXPECT_TRUE(severity.range.whole);
  EXPECT_EQ(std::pair(severity.range.start, severity.range.end), std::pair(1.0, 16.0));
  EXPECT_THAT(Mistake(scenario, {.parameter = "depth_count"}), HasSubstr("give both --low"));
  // Harmful downwards: --low is the mild end all the same.
  const Severity falling = Of(scenario, {.parameter = "depth_count", .low = 16.0, .high = 1.0});
  EXPECT_EQ(std::pair(falling.range.start, falling.range.end), std::pair(16.0, 1.0));
  EXPECT_THAT(Mistake(scenario, {.parameter = "depth"}),
              HasSubstr("it has: probability, depth_count, window_s"));
  EXPECT_EQ(Of(scenario, {.parameter = "window_s"}).parameter, kWindowParameter);
}

}  // namespace
}  // namespace tiltproof::harness
