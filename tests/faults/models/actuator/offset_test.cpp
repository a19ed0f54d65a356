#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/faults/one_signal.h"

namespace tiltproof::faults {
namespace {

TEST(OffsetTest, AddsItsValueInTheWindow) {
  const FaultSpec spec =
      At(Spec("actuator.offset", {{"actuator", "f_r"}, {"value", -1.5}}), kStep, 3 * kStep);
  EXPECT_THAT(RightThrusts(spec, 4, [](std::int64_t n) { return 10.0 + static_cast<double>(n); }),
              ::testing::ElementsAre(10, 9.5, 10.5, 13));
}

}  // namespace
}  // namespace tiltproof::faults
