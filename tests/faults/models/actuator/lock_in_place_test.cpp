#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/faults/one_signal.h"

namespace tiltproof::faults {
namespace {

FaultSpec Lock(TimeNs start_ns, TimeNs end_ns) {
  return At(Spec("actuator.lock_in_place", {{"actuator", "f_r"}}), start_ns, end_ns);
}
double RisingThrust(std::int64_t n) { return 5 + 0.5 * static_cast<double>(n); }

TEST(LockInPlaceTest, KeepsWhatWasInForceBefore) {
  EXPECT_THAT(RightThrusts(Lock(3 * kStep, 6 * kStep), 8, RisingThrust),
              ::testing::ElementsAre(5, 5.5, 6, 6, 6, 6, 8, 8.5));
}

TEST(LockInPlaceTest, FromTheFirstStepOnItKeepsTheFirstCommand) {
  EXPECT_THAT(RightThrusts(Lock(0, kNever), 4, RisingThrust), ::testing::ElementsAre(5, 5, 5, 5));
}

TEST(LockInPlaceTest, EachPeriodLocksAnew) {
  FaultSpec spec = Lock(0, kNever);
  spec.period_ns = 4 * kStep;
  spec.duty = 0.5;
  EXPECT_THAT(RightThrusts(spec, 7, RisingThrust), ::testing::ElementsAre(5, 5, 6, 6.5, 6.5, 6.5, 8));
}

}  // namespace
}  // namespace tiltproof::faults
