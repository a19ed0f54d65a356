#include <gtest/gtest.h>

#include "tests/faults/one_signal.h"

namespace tiltproof::faults {
namespace {

// Tao and Kokotovic, with equal sides and slope 1: m (u - b_r) above b_r, m (u - b_l) below b_l, else 0.
double DeadZone(double u, double b_r, double b_l) { return u >= b_r ? u - b_r : u <= b_l ? u - b_l : 0; }

TEST(DeadbandTest, IsTheDeadZone) {
  const auto command = [](std::int64_t n) { return 0.0625 * static_cast<double>(n - 100); };
  for (const double width : {0.25, 3.0, 12.5}) {
    const auto thrusts =
        RightThrusts(Spec("actuator.deadband", {{"actuator", "f_r"}, {"width", width}}), 200, command);
    for (std::size_t n = 0; n < thrusts.size(); ++n)
      EXPECT_DOUBLE_EQ(thrusts[n], DeadZone(command(static_cast<std::int64_t>(n)), width / 2, -width / 2))
          << n;
  }
}

}  // namespace
}  // namespace tiltproof::faults
