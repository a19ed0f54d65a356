// Computing time against formulas of one fault, and against a slow reference that counts microseconds.
#include "harness/client/computing_time.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

namespace tiltproof::harness {
namespace {

constexpr Origin kOrigin(BootTime(3 * kNsPerMs));

class Draw {
 public:
  std::int64_t operator()(std::int64_t low, std::int64_t high) {
    return low + static_cast<std::int64_t>(random_()) % (high - low + 1);
  }

 private:
  std::mt19937 random_{11};
};

faults::DeviceCommand Slow(TimeNs at_ns, TimeNs until_ns, double factor, std::size_t fault = 0) {
  return {.at_ns = at_ns,
          .until_ns = until_ns,
          .fault = fault,
          .action = faults::SlowProcessor{.factor = factor}};
}
faults::DeviceCommand Delay(TimeNs at_ns, TimeNs until_ns, TimeNs delay_ns, TimeNs every_ns,
                            std::size_t fault = 0) {
  return {.at_ns = at_ns,
          .until_ns = until_ns,
          .fault = fault,
          .action = faults::DelayTask{.delay_ns = delay_ns, .every_ns = every_ns}};
}
Computation Compute(const std::vector<faults::DeviceCommand>& commands, BootTime begin, TimeNs length_ns) {
  SlowSpans slow;
  slow.Add(commands, kOrigin);
  TaskDelays delays;
  delays.Add(commands, kOrigin);
  return ComputeOn(slow, delays, begin, length_ns);
}

TEST(ComputingTimeTest, SoundProcessor) {
  const Computation computation = ComputeOn({}, {}, BootTime(5), 700);
  EXPECT_EQ(computation.end, BootTime(705));
  EXPECT_TRUE(computation.faults.empty());
}

// With u the work before the window [a, b), it ends at a + f r where r is left, or at b + r - (b - a) / f.
TEST(ComputingTimeTest, OneSlowWindowToTheNanosecond) {
  Draw draw;
  int within = 0, beyond = 0, without = 0;
  for (int round = 0; round < 2000; ++round) {
    const std::int64_t factor = std::int64_t{1} << draw(1, 3);
    // Multiples of the factor, so that nothing is rounded.
    const TimeNs a = 8 * draw(0, 3000), b = a + 8 * draw(1, 3000), s = 8 * draw(0, 4000),
                 length = 8 * draw(1, 2000);
    TimeNs end = s + length;
    const bool touches = s < b && end > a;
    if (touches) {
      const TimeNs first = std::max(s, a), left = length - (first - s);
      const bool inside = first + left * factor <= b;
      end = inside ? first + left * factor : b + left - (b - first) / factor;
      ++(inside ? within : beyond);
    } else {
      ++without;
    }
    const Computation computation =
        Compute({Slow(a, b, static_cast<double>(factor))}, kOrigin.ToBootTime(s), length);
    EXPECT_EQ(kOrigin.SimulationTime(computation.end), end) << round;
    EXPECT_EQ(computation.faults.size(), touches ? 1U : 0U) << round;
  }
  EXPECT_GT(std::min({within, beyond, without}), 100);
}

TEST(ComputingTimeTest, PeriodicHoldsToTheNanosecond) {
  Draw draw;
  for (int round = 0; round < 2000; ++round) {
    const TimeNs every = draw(2, 500), delay = draw(1, every - 1), s = draw(0, 2000), length = draw(1, 3000);
    // Work w after the last hold's end at which the task is free e - d in each period of e.
    const TimeNs phase = std::max(s % every, delay), rest = every - phase;
    TimeNs end = s - s % every + phase + length;
    if (length > rest) end += ((length - rest - 1) / (every - delay) + 1) * delay;
    const Computation computation = Compute({Delay(0, kNever, delay, every)}, kOrigin.ToBootTime(s), length);
    EXPECT_EQ(kOrigin.SimulationTime(computation.end), end) << round;
  }
}

TEST(ComputingTimeTest, AsWhenEachMicrosecondIsCounted) {
  Draw draw;
  int stretched = 0;
  for (int round = 0; round < 200; ++round) {
    std::vector<faults::DeviceCommand> commands;
    for (std::size_t fault = 0; fault < 2; ++fault) {
      const TimeNs begin = draw(0, 20) * kNsPerMs;
      commands.push_back(Slow(begin, begin + draw(1, 20) * kNsPerMs, static_cast<double>(draw(1, 4)), fault));
    }
    commands.push_back(
        Delay(draw(0, 10) * kNsPerMs, draw(15, 40) * kNsPerMs, draw(1, 3) * kNsPerMs, 5 * kNsPerMs, 2));
    SlowSpans slow;
    slow.Add(commands, kOrigin);
    TaskDelays delays;
    delays.Add(commands, kOrigin);
    const BootTime begin(draw(0, 30) * kNsPerMs);
    const TimeNs length_ns = draw(1, 20) * kNsPerMs;

    double left_us = static_cast<double>(length_ns) / kNsPerUs;
    BootTime now = begin;
    while (left_us > 1e-6) {
      double speed = delays.At(now) ? 0 : 1;
      for (const SlowSpans::Span& span : slow.spans())
        if (now >= span.begin && now < span.end) speed /= span.factor;
      left_us -= speed;
      now += kNsPerUs;
    }
    const Computation computation = ComputeOn(slow, delays, begin, length_ns);
    EXPECT_NEAR(ToSeconds(computation.end - now), 0, 1e-6) << round;
    if (computation.end - begin > length_ns) {
      ++stretched;
      EXPECT_FALSE(computation.faults.empty());
    }
  }
  EXPECT_GT(stretched, 100);
}

TEST(ComputingTimeTest, EndsHoweverItIsHeld) {
  for (const auto& commands : {std::vector{Delay(0, kNever, 5, 5), Slow(0, kNever, 1000, 1)},
                               std::vector{Delay(0, kNever, kNever / 2, kNever / 2)},
                               std::vector{Slow(0, kNever, 1e3), Slow(0, kNever, 1e3), Slow(0, kNever, 1e3),
                                           Slow(0, kNever, 1e3)}}) {
    const Computation computation = Compute(commands, BootTime(4 * kNsPerMs), 3600 * kNsPerS);
    EXPECT_EQ(computation.end - BootTime(4 * kNsPerMs), 1'000'000 * kNsPerS);
  }
}

}  // namespace
}  // namespace tiltproof::harness
