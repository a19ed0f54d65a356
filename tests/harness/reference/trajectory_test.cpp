#include "harness/reference/trajectory.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

namespace tiltproof::harness {
namespace {

ReferenceSpec Spec(decltype(ReferenceSpec::path) path, bool velocity = true) {
  return {std::move(path), velocity};
}

std::filesystem::path WriteCsv(const std::string& text) {
  const std::filesystem::path file =
      std::filesystem::path(testing::TempDir()) /
      (std::string("reference_") + testing::UnitTest::GetInstance()->current_test_info()->name() + ".csv");
  std::ofstream(file) << text;
  return file;
}

std::string ErrorOf(const std::string& csv) {
  const auto file = WriteCsv(csv);
  try {
    Trajectory trajectory(Spec(RecordedReference{file}));
  } catch (const ReferenceError& error) {
    const std::string text = error.what();
    EXPECT_EQ(text.substr(0, file.string().size()), file.string());
    return text.substr(file.string().size());
  }
  return "no error";
}

// Every kind of reference that moves, with its end (seconds; 0: none).
std::vector<std::pair<ReferenceSpec, double>> MovingSpecs() {
  const auto recorded = WriteCsv(
      "t_s,x_m,y_m,z_m,yaw_rad\n"
      "0,0,0,1,0\n"
      "2.5,1,-1,1,0.5\n"
      "4,1,3,2,0\n");
  return {
      {Spec(SpiralReference{}), 60},
      {Spec(SpiralReference{1.5, 2, -3, {1, 2, 8}, 17}), 17},
      {Spec(WaypointsReference{{{0, 0, 1}, {3, 4, 1}, {3, 4, 1}, {3, 0, 4}}, 2}), 5},
      {Spec(CircleReference{3, 11, {1, 2, 3}}), 0},
      {Spec(EightReference{6, 13, {1, 2, 3}}), 0},
      {Spec(StraightReference{{0, 0, 1}, {4, -2, 3}, 8}), 8},
      {Spec(RecordedReference{recorded}), 4},
  };
}

TEST(Trajectory, SpiralFollowsEquation1) {
  const Trajectory trajectory(Spec(SpiralReference{}));
  // n = 3, T_f = 60 s, d = 5 m, h = 10 m, start (2, 0, 0.5): w = 2 pi 3 / 60 rad/s, a turn takes 20 s.
  struct Point {
    double t_s, x_m, y_m, z_m;
  };
  const double half = 5 * std::numbers::sqrt2 / 2;
  for (const Point& p :
       {Point{0, 2, 0, 0.5}, Point{2.5, half - 3, half, 0.5 + 2.5 / 6}, Point{5, -3, 5, 0.5 + 5.0 / 6},
        Point{10, -8, 0, 0.5 + 10.0 / 6}, Point{35, -3, -5, 0.5 + 35.0 / 6}, Point{40, 2, 0, 0.5 + 40.0 / 6},
        Point{60, 2, 0, 10.5}}) {
    const ReferencePoint r = trajectory.At(FromSeconds(p.t_s));
    EXPECT_NEAR(r.position_m[0], p.x_m, 1e-12) << p.t_s;
    EXPECT_NEAR(r.position_m[1], p.y_m, 1e-12) << p.t_s;
    EXPECT_NEAR(r.position_m[2], p.z_m, 1e-12) << p.t_s;
    EXPECT_EQ(r.yaw_rad, 0.0);
  }
  const ReferencePoint start = trajectory.At(0);
  EXPECT_EQ(start.position_m[0], 2.0);
  EXPECT_EQ(start.position_m[1], 0.0);
  EXPECT_EQ(start.position_m[2], 0.5);
  EXPECT_NEAR(start.velocity_m_s[1], 5 * 2 * std::numbers::pi * 3 / 60, 1e-12);
  EXPECT_NEAR(start.velocity_m_s[2], 10.0 / 60, 1e-12);
}

TEST(Trajectory, VelocityIsTheDerivativeOfPosition) {
  for (const auto& [spec, end_s] : MovingSpecs()) {
    const Trajectory trajectory(spec);
    const TimeNs h = 1'000'000;
    // Times that are no corner of a polyline.
    for (TimeNs t = 11 * kNsPerMs; t < 70 * kNsPerS; t += 137 * kNsPerMs) {
      const ReferencePoint before = trajectory.At(t - h), now = trajectory.At(t),
                           after = trajectory.At(t + h);
      const double span_s = 2 * ToSeconds(h);
      EXPECT_NEAR(now.velocity_m_s[0], (after.position_m[0] - before.position_m[0]) / span_s, 1e-6)
          << spec.path.index() << " at " << t;
      EXPECT_NEAR(now.velocity_m_s[1], (after.position_m[1] - before.position_m[1]) / span_s, 1e-6)
          << spec.path.index() << " at " << t;
      EXPECT_NEAR(now.velocity_m_s[2], (after.position_m[2] - before.position_m[2]) / span_s, 1e-6)
          << spec.path.index() << " at " << t;
    }
  }
}

TEST(Trajectory, WaitsAtItsStartAndHoldsItsEnd) {
  for (const auto& [spec, end_s] : MovingSpecs()) {
    const Trajectory trajectory(spec);
    const auto at_rest = [](ReferencePoint r) {
      r.velocity_m_s = {};
      return r;
    };
    EXPECT_EQ(trajectory.At(-5 * kNsPerMs), at_rest(trajectory.At(0)));
    if (end_s == 0) continue;
    const ReferencePoint end = trajectory.At(FromSeconds(end_s));
    EXPECT_EQ(end, at_rest(end));
    EXPECT_EQ(trajectory.At(FromSeconds(end_s + 1000)), end);
    // Continuous where it stops.
    const ReferencePoint just_before = trajectory.At(FromSeconds(end_s) - 1000);
    EXPECT_NEAR(just_before.position_m[0], end.position_m[0], 1e-5);
    EXPECT_NEAR(just_before.position_m[1], end.position_m[1], 1e-5);
    EXPECT_NEAR(just_before.position_m[2], end.position_m[2], 1e-5);
    EXPECT_NE(just_before, at_rest(just_before));
  }
}

TEST(Trajectory, VelocityCanBeLeftOut) {
  for (auto [spec, end_s] : MovingSpecs()) {
    const Trajectory with(spec);
    spec.velocity = false;
    const Trajectory without(spec);
    for (TimeNs t = 0; t < 20 * kNsPerS; t += kNsPerS / 3) {
      ReferencePoint expected = with.At(t);
      expected.velocity_m_s = {};
      EXPECT_EQ(without.At(t), expected);
    }
  }
}

TEST(Trajectory, HoverStaysWithItsYaw) {
  const Trajectory trajectory(Spec(HoverReference{{1, 2, 3}, 0.5}));
  EXPECT_EQ(trajectory.At(7 * kNsPerS), (ReferencePoint{{1, 2, 3}, 0.5, {0, 0, 0}}));
  EXPECT_EQ(trajectory.Start(), (std::array<double, 3>{1, 2, 3}));
}

TEST(Trajectory, WaypointsAreFlownAtConstantSpeed) {
  const Trajectory trajectory(Spec(WaypointsReference{{{0, 0, 1}, {3, 4, 1}, {3, 4, 3}}, 2}));
  EXPECT_EQ(trajectory.At(FromSeconds(1.25)), (ReferencePoint{{1.5, 2, 1}, 0, {1.2, 1.6, 0}}));
  EXPECT_EQ(trajectory.At(FromSeconds(3)), (ReferencePoint{{3, 4, 2}, 0, {0, 0, 2}}));
  EXPECT_EQ(trajectory.At(FromSeconds(3.5)), (ReferencePoint{{3, 4, 3}, 0, {0, 0, 0}}));
  const Trajectory single(Spec(WaypointsReference{{{1, 2, 3}}, 2}));
  EXPECT_EQ(single.At(kNsPerS), (ReferencePoint{{1, 2, 3}, 0, {0, 0, 0}}));
  EXPECT_THROW(Trajectory(Spec(WaypointsReference{{}, 1})), ReferenceError);
  EXPECT_THROW(Trajectory(Spec(WaypointsReference{{{1, 2, 3}}, 0})), ReferenceError);
}

TEST(Trajectory, CircleAndEightStartWhereTheyAreTold) {
  const Trajectory circle(Spec(CircleReference{5, 20, {1, 2, 3}}));
  EXPECT_EQ(circle.Start(), (std::array<double, 3>{1, 2, 3}));
  EXPECT_NEAR(circle.At(10 * kNsPerS).position_m[0], 1 - 10, 1e-12);
  EXPECT_NEAR(circle.At(20 * kNsPerS).position_m[0], 1, 1e-12);
  const Trajectory eight(Spec(EightReference{8, 20, {1, 2, 3}}));
  EXPECT_EQ(eight.Start(), (std::array<double, 3>{1, 2, 3}));
  EXPECT_NEAR(eight.At(5 * kNsPerS).position_m[0], 1 + 4, 1e-12);
  EXPECT_NEAR(eight.At(5 * kNsPerS).position_m[1], 2, 1e-12);
  EXPECT_NEAR(eight.At(FromSeconds(2.5)).position_m[1], 2 + 2, 1e-12);
}

TEST(Trajectory, RecordedMayBeginWithAByteOrderMark) {
  const auto file = WriteCsv("\xEF\xBB\xBFt_s,x_m,y_m,z_m,yaw_rad\r\n0,1,2,3,0\r\n");
  EXPECT_EQ(Trajectory(Spec(RecordedReference{file})).Start(), (std::array{1.0, 2.0, 3.0}));
}

TEST(Trajectory, RecordedIsInterpolated) {
  const auto file = WriteCsv(
      "t_s,x_m,y_m,z_m,yaw_rad,vx_m_s,vy_m_s,vz_m_s\r\n"
      "1,0,0,1,0,1,2,3\r\n"
      "3,4,2,1,1,3,2,1\r\n");
  const Trajectory trajectory(Spec(RecordedReference{file}));
  EXPECT_EQ(trajectory.At(0), (ReferencePoint{{0, 0, 1}, 0, {0, 0, 0}}));
  EXPECT_EQ(trajectory.At(2 * kNsPerS), (ReferencePoint{{2, 1, 1}, 0.5, {2, 2, 2}}));
  EXPECT_EQ(trajectory.At(9 * kNsPerS), (ReferencePoint{{4, 2, 1}, 1, {0, 0, 0}}));
}

TEST(Trajectory, RecordedColumnsAreReadByName) {
  const auto file = WriteCsv(
      "yaw_rad,note,z_m,y_m,x_m,t_s\n"
      "0.5,take-off,3,2,1,0\n");
  EXPECT_EQ(Trajectory(Spec(RecordedReference{file})).At(0), (ReferencePoint{{1, 2, 3}, 0.5, {}}));
}

// Loggers write yaw in (-pi, pi]: between 3.1 and -3.1 rad a vehicle has turned by 0.083 rad, not by 6.2.
TEST(Trajectory, RecordedYawTurnsTheShortWay) {
  const auto file = WriteCsv(
      "t_s,x_m,y_m,z_m,yaw_rad\n"
      "0,0,0,1,3.1\n"
      "1,0,0,1,-3.1\n"
      "2,0,0,1,3.1\n");
  const Trajectory trajectory(Spec(RecordedReference{file}));
  for (const double t_s : {0.0, 0.25, 0.5, 0.75, 0.999, 1.25, 1.75}) {
    const double yaw_rad = trajectory.At(FromSeconds(t_s)).yaw_rad;
    EXPECT_GE(std::abs(yaw_rad), 3.1) << t_s;
    EXPECT_LE(std::abs(yaw_rad), std::numbers::pi) << t_s;
  }
  EXPECT_NEAR(trajectory.At(FromSeconds(0.25)).yaw_rad, 3.1 + 0.25 * (2 * std::numbers::pi - 6.2), 1e-12);
  EXPECT_NEAR(trajectory.At(FromSeconds(0.75)).yaw_rad, -3.1 - 0.25 * (2 * std::numbers::pi - 6.2), 1e-12);
}

// A log that counts turns stays as it is.
TEST(Trajectory, RecordedYawMayCountTurns) {
  const auto file = WriteCsv("t_s,x_m,y_m,z_m,yaw_rad\n0,0,0,1,3\n1,0,0,1,5\n2,0,0,1,7\n");
  EXPECT_NEAR(Trajectory(Spec(RecordedReference{file})).At(FromSeconds(1.5)).yaw_rad, 6, 1e-12);
}

TEST(Trajectory, BrokenRecordingsAreRefusedWithTheirPlace) {
  const std::string header = "t_s,x_m,y_m,z_m,yaw_rad\n";
  const std::string names =
      "the first line names the columns t_s, x_m, y_m, z_m, yaw_rad, and vx_m_s, vy_m_s, "
      "vz_m_s if there are velocities";
  EXPECT_EQ(ErrorOf(""), ":1: there is no column 't_s': " + names);
  EXPECT_EQ(ErrorOf("t,x,y,z,yaw\n0,0,0,0,0\n"), ":1: there is no column 't_s': " + names);
  EXPECT_EQ(ErrorOf("t_s,x_m,y_m,yaw_rad\n0,0,0,0\n"), ":1: there is no column 'z_m': " + names);
  EXPECT_EQ(ErrorOf("t_s,x_m,y_m,z_m,yaw_rad,vx_m_s\n0,0,0,0,0,0\n"),
            ":1: there is no column 'vy_m_s': " + names);
  EXPECT_EQ(ErrorOf("t_s,x_m,y_m,z_m,yaw_rad,x_m\n0,0,0,0,0,0\n"), ":1: there are two columns 'x_m'");
  EXPECT_EQ(ErrorOf(header), ":1: has no rows");
  EXPECT_EQ(ErrorOf(header + "0,0,0,1\n"), ":2: has 4 columns, the first line has 5");
  EXPECT_EQ(ErrorOf(header + "0,0,0,1,0,0\n"), ":2: has 6 columns, the first line has 5");
  EXPECT_EQ(ErrorOf(header + "0,0,zero,1,0\n"), ":2: 'zero' is not a number");
  EXPECT_EQ(ErrorOf(header + "0,0,0,1,nan\n"), ":2: 'nan' is not a number");
  EXPECT_EQ(ErrorOf(header + "0,0,0,1e999,0\n"), ":2: '1e999' is not a number");
  EXPECT_EQ(ErrorOf(header + "0,0,0,1,0\n\n1,0,0,1,0\n"), ":3: '' is not a number");
  EXPECT_EQ(ErrorOf(header + "0,0,0,1,0\n0,0,0,1,0\n"), ":3: t_s must ascend");
  EXPECT_EQ(ErrorOf(header + "0,0,0,1001,0\n"), ":2: a value is beyond +/-1000 m or m/s");
  EXPECT_EQ(ErrorOf(header + "0,0,0,1,0\n1,0,0,-2,0\n"),
            ":3: z_m = -2 is in the ground: z points up (a recording in NED becomes one with x_m and y_m "
            "exchanged, "
            "-z_m, and pi/2 - yaw_rad)");
  EXPECT_EQ(ErrorOf(header + "0,0,0,1,101\n"), ":2: yaw_rad is beyond +/-100 rad");
  EXPECT_EQ(ErrorOf(header + "0,0,0," + std::string(5000, '1') + ",0\n"), ":2: the line is too long");
  EXPECT_THROW(Trajectory(Spec(RecordedReference{"/nonexistent.csv"})), ReferenceError);
  EXPECT_THROW(Trajectory(Spec(RecordedReference{"/"})), ReferenceError);
}

}  // namespace
}  // namespace tiltproof::harness
