#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/faults/one_signal.h"

namespace tiltproof::faults {
namespace {

TEST(StuckAtTest, ReadsItsValueInTheWindow) {
  const FaultSpec spec =
      At(Spec("sensor.stuck_at", {{"signal", "z_m"}, {"value", -3.3}}), 2 * kPeriod, 4 * kPeriod);
  EXPECT_THAT(ReadHeights(spec, 6, [](std::int64_t n) { return static_cast<float>(n); }),
              ::testing::ElementsAre(0.0F, 1.0F, -3.3F, -3.3F, 4.0F, 5.0F));
}

}  // namespace
}  // namespace tiltproof::faults
