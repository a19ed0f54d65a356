#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/faults/one_signal.h"

namespace tiltproof::faults {
namespace {

TEST(SignFlipTest, ReadsTheNegative) {
  const FaultSpec spec = At(Spec("sensor.sign_flip", {{"signal", "z_m"}}), kPeriod, 4 * kPeriod);
  EXPECT_THAT(ReadHeights(spec, 5, [](std::int64_t n) { return static_cast<float>(n) - 2.5F; }),
              ::testing::ElementsAre(-2.5F, 1.5F, 0.5F, -0.5F, 1.5F));
}

}  // namespace
}  // namespace tiltproof::faults
