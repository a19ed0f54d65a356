// A node's clock that a fault makes wrong.
#include "harness/node/node_clock.h"

#include <gtest/gtest.h>

namespace tiltproof::harness {
namespace {

using Steady = NodeClock::Steady;

BootTime Of(Steady::time_point t) { return BootTime(t.time_since_epoch().count()); }

// Expects the clock to show a time between `shown` of the true times just before and just after, within 2 ns.
template <class Shown>
void ExpectShows(const NodeClock& clock, const Shown& shown) {
  const Steady::time_point before = Steady::now();
  const BootTime now = clock.Now();
  const Steady::time_point after = Steady::now();
  EXPECT_GE(now, shown(before) - 2);
  EXPECT_LE(now, shown(after) + 2);
}

TEST(NodeClock, IsTheMachinesAtFirst) {
  const NodeClock clock;
  ExpectShows(clock, [](Steady::time_point t) { return Of(t); });
  const Steady::time_point t = Steady::now();
  EXPECT_EQ(clock.ToSteady(Of(t)), t);
}

TEST(NodeClock, JumpsAndRunsFast) {
  NodeClock clock;
  const BootTime low = Of(Steady::now());
  clock.SetRate(100'000);
  clock.Jump(5 * kNsPerS);
  const BootTime high = Of(Steady::now());
  // It was set at some instant from low to high.
  const auto shown = [](BootTime t, BootTime set) {
    return set + 5 * kNsPerS + static_cast<TimeNs>(static_cast<double>(t - set) * 1.1);
  };
  const BootTime t = high + 10 * kNsPerS;
  // The inverse: when it shows what it would at t, it is t.
  EXPECT_LE(Of(clock.ToSteady(shown(t, high))), t + 2);
  EXPECT_GE(Of(clock.ToSteady(shown(t, low))), t - 2);
  const BootTime now = clock.Now();
  EXPECT_GE(now, shown(high, high) - 2);
  EXPECT_LE(now, shown(Of(Steady::now()), low) + 2);
}

TEST(NodeClock, ToSteadyIsTheInverseOfNow) {
  for (const double ppm : {-100'000.0, -50.0, 0.0, 3.0, 100'000.0}) {
    for (const TimeNs jump : {-10 * kNsPerS, TimeNs{0}, 10 * kNsPerS}) {
      NodeClock clock;
      clock.SetRate(ppm);
      clock.Jump(jump);
      ExpectShows(clock, [&](Steady::time_point t) {
        // The time that it shows when the true clock shows t, found by halving.
        BootTime low = Of(t) - 100 * kNsPerS, high = Of(t) + 100 * kNsPerS;
        while (high - low > 1) {
          const BootTime middle = low + (high - low) / 2;
          (clock.ToSteady(middle) <= t ? low : high) = middle;
        }
        return low;
      });
    }
  }
}

TEST(NodeClock, KeepsTheJumpWhenItRunsTrueAgain) {
  NodeClock clock;
  clock.Jump(7 * kNsPerS);
  clock.SetRate(0);
  ExpectShows(clock, [](Steady::time_point t) { return Of(t) + 7 * kNsPerS; });
  clock.Jump(-7 * kNsPerS);
  ExpectShows(clock, [](Steady::time_point t) { return Of(t); });
}

}  // namespace
}  // namespace tiltproof::harness
