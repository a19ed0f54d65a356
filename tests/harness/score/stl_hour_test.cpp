// A monitor that looked at every row of every window would need 10^10 steps here, and a test's time limit
// would end it.
#include <gtest/gtest.h>

#include "harness/score/signals.h"
#include "harness/score/stl.h"
#include "tests/support/control_period.h"
#include "tests/support/tiltrotor_signals.h"

namespace tiltproof::harness {
namespace {

constexpr std::size_t kRows = 300'001;  // of 12 ms: one hour

TEST(StlMonitor, AnHourOfNestedWindows) {
  Trace trace({"t_s", "x_m"});
  trace.Reserve(kRows);
  for (std::size_t r = 0; r < kRows; ++r) {
    const auto row = trace.AppendRow();
    row[0] = ToSeconds(static_cast<TimeNs>(r) * kControlPeriodNs);
    row[1] = static_cast<double>(r % 1000);
  }
  const auto robustness = [&](const char* text) {
    return stl::Evaluate(testing::ParseCriterion(text, {}), trace).robustness;
  };
  EXPECT_EQ(robustness("always[0,3000](eventually[0,600](x_m >= 500))"), 499.0);
  EXPECT_EQ(robustness("always[0,3000]((x_m >= 0) until[0,600] (x_m >= 998))"), 0.0);
}

TEST(CrossTrackError, AnHourOfLaps) {
  Trace trace({"t_s", "x_m", "y_m", "z_m", "x_ref_m", "y_ref_m", "z_ref_m"});
  trace.Reserve(kRows);
  for (std::size_t r = 0; r < kRows; ++r) {
    const auto row = trace.AppendRow();
    // A square of side 4, once every 4000 rows, flown half a side late and 1 m above.
    const auto corner = [](std::size_t k, std::size_t axis) {
      const double s = static_cast<double>((k + 1000 * axis) % 4000) / 1000.0;
      return s < 1 ? 4 * s : s < 2 ? 4.0 : s < 3 ? 4 * (3 - s) : 0.0;
    };
    const std::size_t late = r >= 500 ? r - 500 : 0;
    row[0] = ToSeconds(static_cast<TimeNs>(r) * kControlPeriodNs);
    for (std::size_t axis = 0; axis < 2; ++axis) {
      row[1 + axis] = corner(late, axis);
      row[4 + axis] = corner(r, axis);
    }
    row[3] = 3.0;
    row[6] = 2.0;
  }
  const auto error = ReadSignal(trace, "cross_track_error_m");
  for (const double e : error) ASSERT_NEAR(e, 1.0, 1e-12);
}

}  // namespace
}  // namespace tiltproof::harness
