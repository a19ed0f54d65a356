// The column supervisor_state: from changes in time to one value for each row.
#include "harness/run/supervisor_states.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <utility>
#include <vector>

namespace tiltproof::harness {
namespace {

using ::testing::ElementsAre;

// Rows every 12 ms, with one other column.
Trace Rows(std::size_t count) {
  Trace trace(std::vector<std::string>{"t_s", "x_m"});
  for (std::size_t i = 0; i < count; ++i) {
    const auto row = trace.AppendRow();
    row[0] = 0.012 * static_cast<double>(i);
    row[1] = 100.0 + static_cast<double>(i);
  }
  return trace;
}

TEST(SupervisorStates, EachRowHasTheLastStateUpToItsTime) {
  Trace trace = Rows(5);
  const std::vector<ToldChange> changes = {
      {11 * kNsPerMs, 2}, {12 * kNsPerMs, 3}, {25 * kNsPerMs, 4}, {36 * kNsPerMs, 5}};
  AddTold("supervisor_state", changes, kNever, trace);
  ASSERT_THAT(trace.columns(), ElementsAre("t_s", "x_m", "supervisor_state"));
  EXPECT_TRUE(std::isnan(trace.at(0, 2)));  // nothing was said yet
  for (const auto& [row, state] : {std::pair(1, 3.0), {2, 3.0}, {3, 5.0}, {4, 5.0}})
    EXPECT_EQ(trace.at(static_cast<std::size_t>(row), 2), state) << row;
  for (std::size_t row = 0; row < 5; ++row) EXPECT_EQ(trace.at(row, 1), 100.0 + static_cast<double>(row));
}

TEST(SupervisorStates, AClientThatSaysNothingHasNoColumn) {
  Trace trace = Rows(2);
  AddTold("supervisor_state", {}, kNever, trace);
  EXPECT_THAT(trace.columns(), ElementsAre("t_s", "x_m"));
}

TEST(SupervisorStates, WithoutRowsFormulasFindTheName) {
  Trace trace = Rows(0);
  AddTold("supervisor_state", {}, kNever, trace);
  EXPECT_THAT(trace.columns(), ElementsAre("t_s", "x_m", "supervisor_state"));
  EXPECT_EQ(trace.row_count(), 0U);
}

TEST(SupervisorStates, OfSeveralClientsEachHasItsId) {
  Scenario scenario;
  scenario.clients = {{.id = "a", .firmware = ""}, {.id = "b", .firmware = ""}};
  EXPECT_EQ(SupervisorStateColumn(scenario, 1), "supervisor_state_b");
  scenario.clients.pop_back();
  EXPECT_EQ(SupervisorStateColumn(scenario, 0), "supervisor_state");
}

}  // namespace
}  // namespace tiltproof::harness
