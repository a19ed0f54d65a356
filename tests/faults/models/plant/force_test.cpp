#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/faults/faulty_line.h"

namespace tiltproof::faults {
namespace {

TEST(ForceTest, PushesAlongItsDirectionInItsWindow) {
  FaultSpec spec =
      Spec("plant.force", {{"force_n", 10.0}, {"direction", std::array<double, 3>{0.0, 3.0, -4.0}}});
  spec.start_ns = 4 * kNsPerMs;
  spec.end_ns = 12 * kNsPerMs;
  FaultSchedule schedule = AtThePlant({spec});
  Disturbance expected;
  expected.force_n = {0, 6, -8};
  EXPECT_EQ(schedule.DisturbanceOf(0), Disturbance{});
  EXPECT_EQ(schedule.DisturbanceOf(4 * kNsPerMs), expected);
  EXPECT_EQ(schedule.DisturbanceOf(8 * kNsPerMs), expected);
  EXPECT_EQ(schedule.DisturbanceOf(12 * kNsPerMs), Disturbance{});
  EXPECT_THAT(schedule.ActivationCounts(), ::testing::ElementsAre(1));
  EXPECT_EQ(schedule.TakeActivations(kOriginAtPowerOn).at(0).what, "force 0 6 -8 N");
}

TEST(ForceTest, TwoAddUp) {
  const FaultSpec up =
      Spec("plant.force", {{"force_n", 2.0}, {"direction", std::array<double, 3>{0.0, 0.0, 1.0}}}, "up");
  const FaultSpec on =
      Spec("plant.force", {{"force_n", 3.0}, {"direction", std::array<double, 3>{1.0, 0.0, 0.0}}}, "on");
  FaultSchedule schedule = AtThePlant({up, on});
  EXPECT_EQ(schedule.DisturbanceOf(0).force_n, (Disturbance::Vector{3, 0, 2}));
}

}  // namespace
}  // namespace tiltproof::faults
