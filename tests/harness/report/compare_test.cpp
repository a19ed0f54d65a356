// Two traces side by side, against differences worked out by hand.

#include "harness/report/difference.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <string>

namespace tiltproof::harness {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// `rows` rows every 12 ms of a climb, edited by `edit(row number, column name) -> value to add`.
Trace Climb(
    std::size_t rows, const std::function<double(std::size_t, const std::string&)>& add =
                          [](std::size_t, const auto&) { return 0.0; }) {
  Trace trace({"t_s", "x_m", "z_m", "yaw_rad", "f_r_n", "commanded_f_r_n"});
  for (std::size_t r = 0; r < rows; ++r) {
    const auto row = trace.AppendRow();
    const double t = 0.012 * static_cast<double>(r);
    const double values[] = {t, 1.0, 2.0 + 0.5 * t, 3.0, 10.0, 10.0};
    for (std::size_t c = 0; c < 6; ++c) row[c] = values[c] + (c == 0 ? 0.0 : add(r, trace.columns()[c]));
  }
  return trace;
}

const ColumnDifference& Of(const TraceDifference& comparison, const std::string& column) {
  for (const auto& difference : comparison.columns)
    if (difference.column == column) return difference;
  throw std::runtime_error("no column " + column);
}

TEST(CompareTest, EqualTracesDoNotDiffer) {
  const TraceDifference comparison = CompareTraces(Climb(100), Climb(100), 0.0);
  EXPECT_FALSE(comparison.first);
  EXPECT_TRUE(comparison.same_rows());
  EXPECT_EQ(comparison.rows_matched, 100U);
  EXPECT_DOUBLE_EQ(comparison.end_a_s, 99 * 0.012);
  for (const auto& column : comparison.columns) {
    EXPECT_EQ(column.max, 0.0) << column.column;
    EXPECT_EQ(column.rms, 0.0) << column.column;
  }
}

TEST(CompareTest, MaxItsTimeAndRms) {
  // 0.3 in one of four rows, -0.4 in another: rms sqrt((0.09 + 0.16) / 4) = 0.25.
  const Trace b = Climb(4, [](std::size_t r, const std::string& column) {
    return column != "z_m" ? 0.0 : r == 1 ? 0.3 : r == 3 ? -0.4 : 0.0;
  });
  const TraceDifference comparison = CompareTraces(Climb(4), b, 1e-3);
  const ColumnDifference& z = Of(comparison, "z_m");
  EXPECT_NEAR(z.max, 0.4, 1e-12);
  EXPECT_DOUBLE_EQ(z.max_time_s, 0.036);
  EXPECT_NEAR(z.rms, 0.25, 1e-12);
  EXPECT_TRUE(z.is_vehicle);
  EXPECT_FALSE(Of(comparison, "f_r_n").is_vehicle);
  EXPECT_EQ(comparison.columns.front().column, "z_m");  // the worst first
  ASSERT_TRUE(comparison.first);
  EXPECT_DOUBLE_EQ(comparison.first->time_s, 0.012);
  EXPECT_EQ(comparison.first->column, "z_m");
  EXPECT_DOUBLE_EQ(comparison.first->a, 2.006);
  EXPECT_DOUBLE_EQ(comparison.first->b, 2.306);
}

TEST(CompareTest, TheToleranceIsForTheVehicleAlone) {
  const Trace thrust = Climb(
      10, [](std::size_t r, const std::string& column) { return column == "f_r_n" && r > 4 ? 2.0 : 0.0; });
  const TraceDifference other = CompareTraces(Climb(10), thrust, 1e-3);
  EXPECT_FALSE(other.first);
  EXPECT_EQ(Of(other, "f_r_n").max, 2.0);

  const Trace drift = Climb(10, [](std::size_t r, const std::string& column) {
    return column == "x_m" ? 0.25 * static_cast<double>(r) : 0.0;
  });
  // 0.25 r is more than 1 from row 5 on; 1 itself is within.
  EXPECT_DOUBLE_EQ(CompareTraces(Climb(10), drift, 1.0).first.value().time_s, 0.060);
  EXPECT_FALSE(CompareTraces(Climb(10), drift, 2.25).first);
}

TEST(CompareTest, OfTheFirstRowTheColumnFartherApart) {
  const Trace b = Climb(3, [](std::size_t r, const std::string& column) {
    return r == 0 ? 0.0 : column == "x_m" ? 0.01 : column == "z_m" ? 0.02 : 0.0;
  });
  EXPECT_EQ(CompareTraces(Climb(3), b, 1e-3).first.value().column, "z_m");
}

TEST(CompareTest, AnglesTheShortWayRound) {
  const Trace turned = Climb(3, [](std::size_t, const std::string& column) {
    return column == "yaw_rad" ? 2 * std::numbers::pi - 0.25 : 0.0;
  });
  EXPECT_NEAR(Of(CompareTraces(Climb(3), turned, 1e-3), "yaw_rad").max, 0.25, 1e-12);
  // A position is no angle.
  const Trace moved = Climb(
      3, [](std::size_t, const std::string& column) { return column == "x_m" ? 2 * std::numbers::pi : 0.0; });
  EXPECT_NEAR(Of(CompareTraces(Climb(3), moved, 1e-3), "x_m").max, 2 * std::numbers::pi, 1e-12);
}

TEST(CompareTest, AValueThatOnlyOneHasIsADifference) {
  const auto without = [](std::size_t from, const std::string& name) {
    return [from, name](std::size_t r, const std::string& column) {
      return column == name && r >= from ? kNan : 0.0;
    };
  };
  const TraceDifference comparison = CompareTraces(Climb(10), Climb(10, without(6, "z_m")), 1e9);
  ASSERT_TRUE(comparison.first);
  EXPECT_DOUBLE_EQ(comparison.first->time_s, 0.072);
  EXPECT_TRUE(std::isnan(comparison.first->b));
  EXPECT_EQ(Of(comparison, "z_m").one_sided_rows, 4U);
  EXPECT_EQ(Of(comparison, "z_m").max, 0.0);
  // A value that both lack is no difference.
  const Trace gap = Climb(10, without(6, "z_m"));
  EXPECT_FALSE(CompareTraces(gap, gap, 0.0).first);
  EXPECT_EQ(Of(CompareTraces(gap, gap, 0.0), "z_m").one_sided_rows, 0U);
}

TEST(CompareTest, RowsAreMatchedByTime) {
  // B lacks row 2, has one at 0.1 s beside the grid, and ends two rows earlier.
  const Trace a = Climb(12);
  Trace b(a.columns());
  for (std::size_t r = 0; r < 10; ++r) {
    if (r == 2) continue;
    const auto row = b.AppendRow();
    std::copy(a.row(r).begin(), a.row(r).end(), row.begin());
    if (r == 8) {
      row[0] = 0.1;
      row[1] = 77.0;  // compared with nothing
    }
  }
  const TraceDifference comparison = CompareTraces(a, b, 1e-3);
  EXPECT_EQ(comparison.rows_a, 12U);
  EXPECT_EQ(comparison.rows_b, 9U);
  EXPECT_EQ(comparison.rows_matched, 8U);
  EXPECT_FALSE(comparison.same_rows());
  EXPECT_FALSE(comparison.first);
  EXPECT_DOUBLE_EQ(comparison.end_b_s, 0.108);
}

TEST(CompareTest, ColumnsOfOneTraceAreNamed) {
  const Trace a = Climb(2);
  Trace b({"t_s", "z_m", "active_bursts"});
  for (std::size_t r = 0; r < 2; ++r) {
    const auto row = b.AppendRow();
    row[0] = a.at(r, 0);
    row[1] = a.at(r, 2);
    row[2] = 1.0;
  }
  const TraceDifference comparison = CompareTraces(a, b, 1e-3);
  EXPECT_THAT(comparison.columns_of_one(),
              ElementsAre("x_m", "yaw_rad", "f_r_n", "commanded_f_r_n", "active_bursts"));
  EXPECT_EQ(comparison.columns.size(), 1U);
  EXPECT_THAT(CompareTraces(a, a, 0.0).columns_of_one(), IsEmpty());
}

TEST(CompareTest, AFlightDiffersByVerdictToo) {
  FlightDifference comparison;
  comparison.a.score.verdict = comparison.b.score.verdict = Verdict::kPass;
  comparison.trace = CompareTraces(Climb(5), Climb(5), 0.0);
  EXPECT_FALSE(comparison.differs());
  comparison.b.score.verdict = Verdict::kInconclusive;
  EXPECT_TRUE(comparison.differs());
  comparison.b.score.verdict = Verdict::kPass;
  comparison.trace = CompareTraces(Climb(5), Climb(6), 0.0);
  EXPECT_TRUE(comparison.differs());
}

// A turn more is the same attitude, and another command.
TEST(CompareTest, EqualIsToTheBit) {
  const auto edited = [](const char* its, double by) {
    return Climb(
        3, [=](std::size_t r, const std::string& column) { return column == its && r == 1 ? by : 0.0; });
  };
  const TraceDifference difference = CompareTraces(Climb(3), edited("yaw_rad", 2 * std::numbers::pi), 1e-3);
  EXPECT_NEAR(Of(difference, "yaw_rad").max, 0.0, 1e-12);
  EXPECT_FALSE(Of(difference, "yaw_rad").equal);
  EXPECT_TRUE(Of(difference, "x_m").equal);
  EXPECT_TRUE(Of(CompareTraces(edited("x_m", kNan), edited("x_m", kNan), 0.0), "x_m").equal);
  EXPECT_FALSE(Of(CompareTraces(edited("x_m", kNan), Climb(3), 0.0), "x_m").equal);
}

TEST(CompareTest, ATraceWithoutAscendingTimeIsRefused) {
  Trace trace({"t_s", "x_m"});
  for (int r = 0; r < 2; ++r) {
    const auto row = trace.AppendRow();
    row[0] = row[1] = 0.0;
  }
  EXPECT_THROW(CompareTraces(trace, Climb(2), 1e-3), std::invalid_argument);
}

}  // namespace
}  // namespace tiltproof::harness
