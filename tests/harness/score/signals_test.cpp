#include "harness/score/signals.h"

#include <gtest/gtest.h>
// rapidcheck needs GoogleTest's macros.
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "harness/reference/reference_path.h"
#include "harness/run/run_log.h"
#include "tests/harness/score/still_flight.h"
#include "tests/support/control_period.h"
#include "tests/support/tiltrotor_signals.h"

namespace tiltproof::harness {
namespace {

// One row, of the columns named.
Trace OneRow(std::vector<std::string> columns, const std::vector<double>& values) {
  Trace trace(std::move(columns));
  const auto row = trace.AppendRow();
  std::copy(values.begin(), values.end(), row.begin());
  return trace;
}

TEST(Signals, NamesAreTheTracesAndTheComputedOnes) {
  Trace trace = testing::TiltrotorTrace();
  const auto names = SignalNames(trace.columns());
  ASSERT_EQ(names.size(), trace.columns().size() + 6);
  EXPECT_TRUE(std::equal(trace.columns().begin(), trace.columns().end(), names.begin()));
  trace.AppendRow();
  for (const std::string& name : names) EXPECT_EQ(ReadSignal(trace, name).size(), 1u) << name;
}

TEST(Signals, PositionErrorAndSpeedAreMagnitudes) {
  const Trace trace =
      OneRow({"x_m", "y_m", "z_m", "x_ref_m", "y_ref_m", "z_ref_m", "vx_m_s", "vy_m_s", "vz_m_s"},
             {1, 2, 3, 3, 5, 9, -1, 4, 8});
  EXPECT_EQ(ReadSignal(trace, "position_error_m"), std::vector<double>{7.0});
  EXPECT_EQ(ReadSignal(trace, "speed_m_s"), std::vector<double>{9.0});
  EXPECT_THROW(ReadSignal(trace, "tilt_rad"), std::invalid_argument);
  EXPECT_THROW(ReadSignal(trace, "no_such"), std::invalid_argument);
}

TEST(Signals, TiltIsTheAngleBetweenTheVerticals) {
  const auto tilt = [](double roll_rad, double pitch_rad) {
    return ReadSignal(OneRow({"roll_rad", "pitch_rad"}, {roll_rad, pitch_rad}), "tilt_rad").front();
  };
  EXPECT_EQ(tilt(0, 0), 0.0);
  EXPECT_NEAR(tilt(0.3, 0), 0.3, 1e-15);
  EXPECT_NEAR(tilt(0, -1.2), 1.2, 1e-15);
  EXPECT_NEAR(tilt(1e-9, 0), 1e-9, 1e-24);
  EXPECT_NEAR(tilt(0.3, 0.4), std::acos(std::cos(0.3) * std::cos(0.4)), 1e-14);
  EXPECT_NEAR(tilt(std::numbers::pi, 0), std::numbers::pi, 1e-15);
  EXPECT_TRUE(std::isnan(tilt(kNan, 0)));
}

TEST(Signals, HeadingErrorIsTheShortWayRound) {
  const auto error = [](double yaw_rad, double reference_rad) {
    return ReadSignal(OneRow({"yaw_rad", "yaw_ref_rad"}, {yaw_rad, reference_rad}), "heading_error_rad")
        .front();
  };
  EXPECT_EQ(error(0.25, 0.5), -0.25);
  EXPECT_NEAR(error(3.1, -3.1), 6.2 - 2 * std::numbers::pi, 1e-14);
  EXPECT_NEAR(error(-3.1, 3.1), 2 * std::numbers::pi - 6.2, 1e-14);
  EXPECT_EQ(error(-std::numbers::pi, 0), std::numbers::pi);  // one value for half a turn
  EXPECT_EQ(error(std::numbers::pi, 0), std::numbers::pi);
  EXPECT_NEAR(error(0.1, 4 * std::numbers::pi), 0.1, 1e-14);  // a recording may count turns
  EXPECT_TRUE(std::isnan(error(kNan, 0)));
}

TEST(Signals, OnGroundIsItsColumnAndZeroWithoutOne) {
  EXPECT_EQ(ReadSignal(OneRow({"t_s"}, {0}), "on_ground"), std::vector<double>{0.0});
  const Trace standing = OneRow({"t_s", "on_ground"}, {0, 1});
  EXPECT_EQ(ReadSignal(standing, "on_ground"), std::vector<double>{1.0});
  const auto names = SignalNames(standing.columns());
  EXPECT_EQ(std::count(names.begin(), names.end(), "on_ground"), 1);
}

TEST(Signals, CrossTrackErrorForgivesBeingLate) {
  Trace trace({"x_m", "y_m", "z_m", "x_ref_m", "y_ref_m", "z_ref_m"});
  const std::vector<std::vector<double>> rows = {{0, 1, 0, 0, 0, 0},
                                                 {1, 0, 2, 10, 0, 0},
                                                 {13, 4, 0, 10, 0, 0},
                                                 {kNan, 0, 0, 10, 0, 0},
                                                 {10, 7, 0, kNan, 0, 0}};
  for (const auto& values : rows) std::copy(values.begin(), values.end(), trace.AppendRow().begin());
  const auto error = ReadSignal(trace, "cross_track_error_m");
  EXPECT_EQ(error[0], 1.0);
  EXPECT_EQ(error[1], 2.0);  // 9.2 m behind its reference, 2 m beside the path
  EXPECT_EQ(error[2], 5.0);  // beyond the end
  EXPECT_TRUE(std::isnan(error[3]));
  EXPECT_EQ(error[4], 7.0);
}

TEST(Signals, ScalesAreTheTables) {
  const Trace trace(
      SignalTable({{"gyro_x_rad_s", "rad/s", 0.25, SignalFrame::kBody}, {"fill_ratio", "", 3.0, {}}}));
  EXPECT_EQ(SignalScale(trace, "gyro_x_rad_s"), 0.25);
  EXPECT_EQ(SignalScale(trace, "fill_ratio"), 3.0);
  EXPECT_EQ(SignalScale(trace, "tilt_rad"), 0.5);  // computed
}

TEST(Signals, ScalesGoByTheUnit) {
  const Trace trace = testing::TiltrotorTrace();
  EXPECT_EQ(SignalScale(trace, "x_m"), 1.0);
  EXPECT_EQ(SignalScale(trace, "roll_rad"), 0.5);
  EXPECT_EQ(SignalScale(trace, "yaw_ref_rad"), 0.5);
  EXPECT_EQ(SignalScale(trace, "wx_rad_s"), 1.0);
  EXPECT_EQ(SignalScale(trace, "tau_r_nm"), 1.0);
  EXPECT_EQ(SignalScale(trace, "faults_active_count"), 1.0);
}

TEST(Signals, RowTimesAreExactToTheNanosecond) {
  Trace trace({"t_s"});
  for (TimeNs k = 0; k < 100'000; ++k) trace.AppendRow()[0] = ToSeconds(k * kControlPeriodNs);
  const auto times = RowTimes(trace);
  for (TimeNs k = 0; k < 100'000; ++k) ASSERT_EQ(times[static_cast<std::size_t>(k)], k * kControlPeriodNs);
  trace.AppendRow()[0] = kNan;
  EXPECT_THROW(RowTimes(trace), std::invalid_argument);
}

TEST(ReferencePath, OfNoPointHasNoDistance) {
  EXPECT_TRUE(std::isnan(ReferencePath({}).DistanceTo({0, 0, 0})));
  const std::vector<Point> points = {{1, 2, 3}, {1, 2, 3}, {kNan, 0, 0}};
  EXPECT_EQ(ReferencePath(points).DistanceTo({1, 2, 5}), 2.0);
}

// Every segment, one after the other.
double SlowDistance(const std::vector<Point>& points, const Point& p) {
  double best = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i + 1 < points.size(); ++i) {
    double along = 0, length = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      along += (p[k] - points[i][k]) * (points[i + 1][k] - points[i][k]);
      length += (points[i + 1][k] - points[i][k]) * (points[i + 1][k] - points[i][k]);
    }
    const double s = length > 0 ? std::min(1.0, std::max(0.0, along / length)) : 0.0;
    double sum = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const double d = points[i][k] + s * (points[i + 1][k] - points[i][k]) - p[k];
      sum += d * d;
    }
    best = std::min(best, std::sqrt(sum));
  }
  return best;
}

RC_GTEST_PROP(ReferencePath, AgreesWithLookingAtEverySegment, ()) {
  const auto point = [] {
    Point p;
    for (double& x : p) x = *rc::gen::inRange(-20, 20) * 0.25;
    return p;
  };
  std::vector<Point> points(static_cast<std::size_t>(*rc::gen::inRange(2, 70)));
  for (Point& p : points) p = point();
  const ReferencePath path(points);
  for (int i = 0; i < 10; ++i) {
    const Point p = point();
    RC_ASSERT(std::abs(path.DistanceTo(p) - SlowDistance(points, p)) <= 1e-12);
  }
}

}  // namespace
}  // namespace tiltproof::harness
