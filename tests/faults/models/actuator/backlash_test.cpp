#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/faults/one_signal.h"

namespace tiltproof::faults {
namespace {

// The play operator, case by case.
TEST(BacklashTest, IsThePlayOperator) {
  constexpr double kWidth = 1.5;
  const auto command = [](std::int64_t n) {
    return 10 + 2 * std::sin(0.05 * static_cast<double>(n)) + std::sin(0.31 * static_cast<double>(n));
  };
  const FaultSpec spec =
      At(Spec("actuator.backlash", {{"actuator", "f_r"}, {"width", kWidth}}), 100 * kStep, 900 * kStep);
  const auto thrusts = RightThrusts(spec, 1000, command);
  double output = command(99);
  int held = 0;
  for (std::int64_t n = 0; n < 1000; ++n) {
    const double u = command(n);
    const double actual = thrusts[static_cast<std::size_t>(n)];
    if (n < 100 || n >= 900) {
      EXPECT_EQ(actual, u) << n;
      continue;
    }
    if (u - output > kWidth / 2)
      output = u - kWidth / 2;
    else if (output - u > kWidth / 2)
      output = u + kWidth / 2;
    else
      ++held;
    EXPECT_DOUBLE_EQ(actual, output) << n;
  }
  EXPECT_GT(held, 100);
  EXPECT_LT(held, 700);
}

TEST(BacklashTest, AReversalFirstCrossesThePlay) {
  const FaultSpec spec = Spec("actuator.backlash", {{"actuator", "f_r"}, {"width", 2.0}});
  const std::vector<double> commands = {10, 11, 12, 13, 12, 11, 10, 9};
  EXPECT_THAT(RightThrusts(spec, 8, [&](std::int64_t n) { return commands[static_cast<std::size_t>(n)]; }),
              ::testing::ElementsAre(10, 10, 11, 12, 12, 12, 11, 10));
}

}  // namespace
}  // namespace tiltproof::faults
