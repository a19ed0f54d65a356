#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/faults/faulty_line.h"

namespace tiltproof::faults {
namespace {

FaultSpec Sag(double share_per_s) { return Spec("plant.battery_sag", {{"share_per_s", share_per_s}}); }

TEST(BatterySagTest, ScalesAllRotorsByTheTimeSinceItsStart) {
  FaultSchedule schedule = AtThePlant({At(Sag(0.25), kNsPerS, 6 * kNsPerS)});
  constexpr TimeNs kStep = 4 * kNsPerMs;
  for (TimeNs t = 0; t < 7 * kNsPerS; t += kStep) {
    const Disturbance sag = schedule.DisturbanceOf(t);
    // On the scale of a human: whole before and after, and nothing is left after 4 s.
    const double expected = t < kNsPerS || t >= 6 * kNsPerS ? 1
                            : t >= 5 * kNsPerS              ? 0
                                                            : 1 - 0.25 * ToSeconds(t - kNsPerS);
    for (std::size_t rotor = 0; rotor < 2; ++rotor)
      ASSERT_NEAR(sag.thrust_factor[rotor], expected, 1e-12) << t;
    // The tilt-rotor has no third rotor.
    ASSERT_EQ(sag.thrust_factor[2], 1);
  }
  EXPECT_THAT(schedule.ActivationCounts(), ::testing::ElementsAre(1));
  const auto activation = schedule.TakeActivations(kOriginAtPowerOn).at(0);
  EXPECT_EQ(activation.time_ns, kNsPerS + kStep);
  EXPECT_EQ(activation.what, "thrust of rotor 0 times 0.999, thrust of rotor 1 times 0.999");
}

TEST(BatterySagTest, MultipliesWithAWeakRotor) {
  FaultSpec weak = Spec("plant.thrust", {{"rotor", "left"}, {"factor", 0.5}}, "weak");
  FaultSchedule schedule = AtThePlant({Sag(0.1), weak});
  schedule.DisturbanceOf(0);
  Disturbance both;
  for (TimeNs t = 4 * kNsPerMs; t <= kNsPerS; t += 4 * kNsPerMs) both = schedule.DisturbanceOf(t);
  EXPECT_NEAR(both.thrust_factor[0], 0.9, 1e-12);
  EXPECT_NEAR(both.thrust_factor[1], 0.45, 1e-12);
}

TEST(BatterySagTest, AtShareZeroChangesNothing) {
  FaultSchedule schedule = AtThePlant({Sag(0)});
  EXPECT_EQ(schedule.DisturbanceOf(0), Disturbance{});
  EXPECT_EQ(schedule.DisturbanceOf(4 * kNsPerMs), Disturbance{});
}

}  // namespace
}  // namespace tiltproof::faults
