#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/faults/one_signal.h"

namespace tiltproof::faults {
namespace {

FaultSpec Oscillation(double amplitude, double frequency_hz) {
  return Spec("actuator.oscillation",
              {{"actuator", "f_r"}, {"amplitude", amplitude}, {"frequency_hz", frequency_hz}});
}

TEST(OscillationTest, IsASineFromTheBeginOfTheWindow) {
  constexpr double kTwoPi = 6.283185307179586;
  for (const double frequency_hz : {0.0, 0.7, 3.0, 124.0}) {
    const auto thrusts = RightThrusts(At(Oscillation(1.5, frequency_hz), 10 * kStep, 2000 * kStep), 2100,
                                      [](std::int64_t) { return 10.0; });
    for (std::int64_t n = 0; n < 2100; ++n) {
      const double t = 0.004 * static_cast<double>(n - 10);
      const double swing = n < 10 || n >= 2000 ? 0 : 1.5 * std::sin(kTwoPi * frequency_hz * t);
      EXPECT_NEAR(thrusts[static_cast<std::size_t>(n)], 10 + swing, 1e-9) << frequency_hz << " " << n;
    }
  }
}

TEST(OscillationTest, BeginsAnewInEachPeriod) {
  FaultSpec spec = At(Oscillation(2, 62.5), 0);  // a quarter of a turn in each step
  spec.period_ns = 5 * kStep;
  spec.duty = 0.6;
  const auto thrusts = RightThrusts(spec, 10, [](std::int64_t) { return 10.0; });
  const std::vector<double> expected = {10, 12, 10, 10, 10, 10, 12, 10, 10, 10};
  for (std::size_t n = 0; n < expected.size(); ++n) EXPECT_NEAR(thrusts[n], expected[n], 1e-12) << n;
}

}  // namespace
}  // namespace tiltproof::faults
