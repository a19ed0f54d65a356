#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/faults/one_signal.h"

namespace tiltproof::faults {
namespace {

TEST(FloatTest, ExertsNothingInTheWindow) {
  const FaultSpec spec = At(Spec("actuator.float", {{"actuator", "f_r"}}), kStep, 3 * kStep);
  EXPECT_THAT(RightThrusts(spec, 5, [](std::int64_t n) { return 10.0 + static_cast<double>(n); }),
              ::testing::ElementsAre(10, 0, 0, 13, 14));
}

}  // namespace
}  // namespace tiltproof::faults
