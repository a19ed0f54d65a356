#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/faults/one_signal.h"

namespace tiltproof::faults {
namespace {

FaultSpec Lag(double time_constant_s) {
  return At(Spec("actuator.lag", {{"actuator", "f_r"}, {"time_constant_s", time_constant_s}}), kStep);
}

// From 10 N to 4 N, commanded at the window's begin.
TEST(LagTest, AStepBecomesAnExponential) {
  for (const double time_constant_s : {0.001, 0.05, 3.0}) {
    const auto thrusts =
        RightThrusts(Lag(time_constant_s), 1000, [](std::int64_t n) { return n == 0 ? 10.0 : 4.0; });
    for (std::size_t n = 0; n < thrusts.size(); ++n)
      EXPECT_NEAR(thrusts[n], 4 + 6 * std::exp(-0.004 * static_cast<double>(n) / time_constant_s), 1e-12)
          << n;
  }
}

// A ramp is followed at a distance: r T (1 - exp(-t / T)) behind, but for the step that a held command is ahead.
TEST(LagTest, ARampIsFollowedAtADistance) {
  constexpr double kTimeConstant_s = 0.2, kRate = 3;
  const auto ramp = [](std::int64_t n) { return 5 + kRate * 0.004 * static_cast<double>(n); };
  const auto thrusts = RightThrusts(Lag(kTimeConstant_s), 1500, ramp);
  const double a = -std::expm1(-0.004 / kTimeConstant_s);
  EXPECT_NEAR(ramp(1499) - thrusts[1499], kRate * 0.004 * (1 - a) / a, 1e-9);
  EXPECT_NEAR(ramp(1499) - thrusts[1499], kRate * kTimeConstant_s, kRate * 0.004);
}

TEST(LagTest, WithoutAStepBeforeItBeginsWithTheFirstCommand) {
  FaultSpec spec = Lag(1);
  spec.start_ns = kPowerOn;
  EXPECT_THAT(RightThrusts(spec, 3, [](std::int64_t) { return 9.0; }), ::testing::ElementsAre(9, 9, 9));
}

}  // namespace
}  // namespace tiltproof::faults
