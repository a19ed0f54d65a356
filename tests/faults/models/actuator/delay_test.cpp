#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "tests/faults/one_signal.h"

namespace tiltproof::faults {
namespace {

double WavingThrust(std::int64_t n) { return 10 + 3 * std::sin(0.1 * static_cast<double>(n)); }

TEST(ActuatorDelayTest, IsACopyShiftedByWholeSteps) {
  for (const auto& [delay_ms, steps] : std::vector<std::pair<double, std::int64_t>>{
           {1, 1}, {4, 1}, {4.001, 2}, {10, 3}, {400, 100}, {10'000, 2500}}) {
    const FaultSpec spec = Spec("actuator.delay", {{"actuator", "f_r"}, {"delay_ms", delay_ms}});
    const auto thrusts = RightThrusts(spec, 3000, WavingThrust);
    for (std::int64_t n = 0; n < 3000; ++n)
      ASSERT_EQ(thrusts[static_cast<std::size_t>(n)], WavingThrust(std::max<std::int64_t>(0, n - steps)))
          << delay_ms << " " << n;
  }
}

TEST(ActuatorDelayTest, TakesCommandsOfBeforeTheWindow) {
  const FaultSpec spec =
      At(Spec("actuator.delay", {{"actuator", "f_r"}, {"delay_ms", 12.0}}), 5 * kStep, 8 * kStep);
  const auto thrusts = RightThrusts(spec, 10, WavingThrust);
  for (std::int64_t n = 0; n < 10; ++n)
    EXPECT_EQ(thrusts[static_cast<std::size_t>(n)], WavingThrust(n >= 5 && n < 8 ? n - 3 : n)) << n;
}

}  // namespace
}  // namespace tiltproof::faults
