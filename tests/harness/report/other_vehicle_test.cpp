// A vehicle that is none of ours - 9 states, 5 sensors, 3 inputs - through trace, metrics, criteria and files.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <numeric>

#include "harness/report/difference.h"
#include "harness/report/flight_files.h"
#include "harness/run/trace.h"
#include "harness/score/score.h"
#include "harness/score/signals.h"
#include "tests/support/control_period.h"

namespace tiltproof::harness {
namespace {

namespace fs = std::filesystem;

SignalTable Table(std::initializer_list<const char*> names) {
  std::vector<Signal> signals;
  for (const char* name : names) signals.push_back(SignalNamed(name, SignalFrame::kBody));
  return SignalTable(std::move(signals));
}

VehicleSignals Airship() {
  return {.states =
              Table({"x_m", "y_m", "z_m", "roll_rad", "pitch_rad", "yaw_rad", "vx_m_s", "vy_m_s", "vz_m_s"}),
          .sensors = Table({"gyro_x_rad_s", "gyro_y_rad_s", "gyro_z_rad_s", "height_m", "ballonet_ratio"}),
          .inputs = Table({"f_bow_n", "f_stern_n", "valve_ratio"})};
}

Scenario TwoRows() {
  Scenario scenario;
  scenario.duration_ns = kControlPeriodNs;
  faults::FaultSpec fault;
  fault.id = "gust";
  fault.type = "wire.bit_error";
  scenario.faults = {fault};
  CriterionSpec criterion;
  criterion.name = "turns";
  criterion.stl = "always(sensed_gyro_y_rad_s + f_stern_n <= 21)";
  scenario.criteria = {criterion};
  return scenario;
}

// Every column has its own number, so that one in the place of another shows.
RunLog Flight(const Scenario& scenario) {
  RunLog log;
  log.trace = Trace(TraceLayout(Airship(), scenario).columns);
  log.hover_input = {10, 20, 0.5};
  log.input_min = {0, 0, 0};
  log.input_max = {30, 30, 1};
  log.clients[0].starts_accepted_count = 1;
  log.end_ns = scenario.duration_ns;
  log.fault_activation_counts = {1};
  for (int r = 0; r < 2; ++r) {
    const auto row = log.trace.AppendRow();
    std::iota(row.begin(), row.end(), 0.0);
    row[0] = r * 0.012;
  }
  return log;
}

TEST(OtherVehicle, ColumnsFollowItsTable) {
  const TraceLayout layout(Airship(), TwoRows());
  std::vector<std::string> names;
  for (const Signal& signal : layout.columns) names.push_back(signal.name);
  const std::vector<std::string> first = {"t_s",
                                          "x_m",
                                          "y_m",
                                          "z_m",
                                          "roll_rad",
                                          "pitch_rad",
                                          "yaw_rad",
                                          "vx_m_s",
                                          "vy_m_s",
                                          "vz_m_s",
                                          "f_bow_n",
                                          "f_stern_n",
                                          "valve_ratio",
                                          "x_ref_m",
                                          "y_ref_m",
                                          "z_ref_m",
                                          "yaw_ref_rad",
                                          "sensed_gyro_x_rad_s",
                                          "sensed_gyro_y_rad_s",
                                          "sensed_gyro_z_rad_s",
                                          "sensed_height_m",
                                          "sensed_ballonet_ratio",
                                          "commanded_f_bow_n",
                                          "commanded_f_stern_n",
                                          "commanded_valve_ratio",
                                          "faults_active_count"};
  ASSERT_EQ(names.size(), first.size() + 9 + 1);
  EXPECT_TRUE(std::equal(first.begin(), first.end(), names.begin()));
  EXPECT_EQ(names.back(), "active_gust");
  EXPECT_EQ(names[layout.states], "x_m");
  EXPECT_EQ(names[layout.inputs], "f_bow_n");
  EXPECT_EQ(names[layout.reference], "x_ref_m");
  EXPECT_EQ(names[layout.sensed], "sensed_gyro_x_rad_s");
  EXPECT_EQ(names[layout.commanded], "commanded_f_bow_n");
  EXPECT_EQ(names[layout.link_counters], "to_plant_frames_sent_count");
  EXPECT_EQ(names[layout.active], "active_gust");
}

TEST(OtherVehicle, IsScored) {
  const Scenario scenario = TwoRows();
  const Score score = ScoreRun(scenario, Flight(scenario));
  // The inputs' columns are 10, 11 and 12 in both rows: 0, -9 and 11.5 from hover, held for one period.
  EXPECT_DOUBLE_EQ(score.metrics.at("control.effort"), (81 + 11.5 * 11.5) * 0.012);
  EXPECT_DOUBLE_EQ(score.metrics.at("control.saturation_ratio"), 1.0);  // the valve is beyond its end
  ASSERT_EQ(score.criteria.back().name, "turns");
  EXPECT_EQ(score.criteria.back().verdict, Verdict::kFail);  // 18 + 11 > 21
  EXPECT_DOUBLE_EQ(score.criteria.back().robustness.value(), -8.0);
}

TEST(OtherVehicle, SurvivesItsFolder) {
  const Scenario scenario = TwoRows();
  const RunLog log = Flight(scenario);
  const fs::path folder = fs::temp_directory_path() / ("tiltproof-other-vehicle-" + std::to_string(getpid()));
  fs::create_directories(folder);
  WriteFlight(folder, scenario, log);
  const RunLog again = ReadFlight(folder);
  fs::remove_all(folder);
  EXPECT_EQ(again.trace.columns(), log.trace.columns());
  EXPECT_EQ(again.hover_input, log.hover_input);
  EXPECT_EQ(again.input_max, log.input_max);
  EXPECT_EQ(ScoreRun(scenario, again).metrics, ScoreRun(scenario, log).metrics);
}

TEST(OtherVehicle, ItsStatesDecideWhetherFlightsDiffer) {
  const Scenario scenario = TwoRows();
  const Trace a = Flight(scenario).trace;
  const auto moved = [&](const char* column) {
    Trace b(a.columns());
    for (std::size_t r = 0; r < a.row_count(); ++r) {
      const auto row = b.AppendRow();
      std::copy(a.row(r).begin(), a.row(r).end(), row.begin());
      row[*b.Find(column)] += 1.0;
    }
    return CompareTraces(a, b, 1e-3).first.has_value();
  };
  EXPECT_TRUE(moved("vz_m_s"));
  EXPECT_FALSE(moved("f_bow_n"));
  EXPECT_FALSE(moved("sensed_height_m"));
}

TEST(OtherVehicle, InputsThatItDoesNotHaveAreAnError) {
  const Scenario scenario = TwoRows();
  RunLog log = Flight(scenario);
  log.hover_input = {1, 2, 3, 4};
  const Score score = ScoreRun(scenario, log);
  EXPECT_EQ(score.verdict, Verdict::kError);
  EXPECT_THAT(score.reason, ::testing::HasSubstr("the trace has 3 inputs, the vehicle's hover 4"));
}

}  // namespace
}  // namespace tiltproof::harness
