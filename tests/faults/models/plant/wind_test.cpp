#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/faults/faulty_line.h"

namespace tiltproof::faults {
namespace {

constexpr TimeNs kWindStep = 4 * kNsPerMs;

FaultSpec Gust(double speed_m_s, double length_m) {
  return Spec("plant.gust", {{"speed_m_s", speed_m_s},
                             {"direction", std::array<double, 3>{0.0, 0.0, 2.0}},
                             {"length_m", length_m}});
}

TEST(WindTest, BlowsWithItsSpeedAlongItsDirection) {
  FaultSchedule schedule = AtThePlant(
      {At(Spec("plant.wind", {{"speed_m_s", 10.0}, {"direction", std::array<double, 3>{-6.0, 8.0, 0.0}}}),
          kWindStep)});
  EXPECT_EQ(schedule.DisturbanceOf(0), Disturbance{});
  EXPECT_EQ(schedule.DisturbanceOf(kWindStep).wind_m_s, (Disturbance::Vector{-6, 8, 0}));
}

// sin^2 of half the angle is the same curve, written otherwise.
TEST(GustTest, RisesAsHalfAPeriodOfACosineAndStays) {
  constexpr double kSpeed = 5, kLength = 2;  // 0.4 s
  FaultSchedule schedule = AtThePlant({At(Gust(kSpeed, kLength), kNsPerS, 2 * kNsPerS)});
  for (int n = 0; n < 600; ++n) {
    const double wind_m_s = schedule.DisturbanceOf(n * kWindStep).wind_m_s[2];
    const double since_s = 0.004 * n - 1;
    if (since_s < 0 || since_s >= 1) {
      EXPECT_EQ(wind_m_s, 0) << n;
    } else if (since_s >= 0.4) {
      EXPECT_EQ(wind_m_s, kSpeed) << n;
    } else {
      EXPECT_NEAR(wind_m_s, kSpeed * std::pow(std::sin(M_PI / 2 * since_s / 0.4), 2), 1e-9) << n;
    }
  }
}

TEST(GustTest, AnIntermittentOneBeginsAnewInEachPeriod) {
  FaultSpec spec = At(Gust(5, 2), 0);
  spec.period_ns = kNsPerS;
  spec.duty = 0.5;
  FaultSchedule schedule = AtThePlant({spec});
  std::vector<double> first, second;
  for (int n = 0; n < 500; ++n)
    (n < 250 ? first : second).push_back(schedule.DisturbanceOf(n * kWindStep).wind_m_s[2]);
  EXPECT_EQ(first, second);
  EXPECT_EQ(schedule.ActivationCounts().at(0), 2);
}

}  // namespace
}  // namespace tiltproof::faults
