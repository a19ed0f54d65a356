// When other work holds the firmware's task, against a list of intervals and a walk through time step by step.
#include "harness/client/task_delays.h"

#include <gtest/gtest.h>

#include <rapidcheck/gtest.h>

#include <algorithm>

#include "tests/support/origins.h"

namespace tiltproof::harness {
namespace {

faults::DeviceCommand Work(TimeNs begin, TimeNs end, TimeNs delay, TimeNs every, std::size_t fault = 0) {
  return {.at_ns = begin,
          .until_ns = end,
          .fault = fault,
          .action = faults::DelayTask{.delay_ns = delay, .every_ns = every}};
}

TEST(TaskDelays, HoldsTheTaskWhileTheWorkLasts) {
  constexpr Origin kOrigin(BootTime{7});
  TaskDelays delays;
  delays.Add({Work(100, 1000, 30, 200)}, kOrigin);
  const auto until = [&](TimeNs time) -> TimeNs {
    const auto hold = delays.At(kOrigin.ToBootTime(time));
    return hold ? (hold->until - kOrigin.ToBootTime(0)) : -1;
  };
  EXPECT_EQ(until(99), -1);
  EXPECT_EQ(until(100), 130);
  EXPECT_EQ(until(129), 130);
  EXPECT_EQ(until(130), -1);
  EXPECT_EQ(until(300), 330);
  EXPECT_EQ(until(500), 530);
  EXPECT_EQ(until(1100), -1);
}

TEST(TaskDelays, EndsWithTheWindow) {
  TaskDelays delays;
  delays.Add({Work(0, 50, 100, 100, 3)}, kOriginAtPowerOn);
  EXPECT_EQ(delays.At(BootTime(10))->until, BootTime(50));
  EXPECT_EQ(delays.At(BootTime(10))->fault, 3U);
  EXPECT_FALSE(delays.At(BootTime(50)));
}

RC_GTEST_PROP(TaskDelays, TheTaskRunsWhenNoWorkIsUnderWay, ()) {
  std::vector<faults::DeviceCommand> commands;
  const auto count = *rc::gen::inRange(1, 4);
  for (int i = 0; i < count; ++i) {
    const TimeNs begin = *rc::gen::inRange(0, 60);
    commands.push_back(Work(begin, begin + *rc::gen::inRange(1, 200), *rc::gen::inRange(0, 40),
                            *rc::gen::inRange(1, 40), static_cast<std::size_t>(i)));
  }
  TaskDelays delays;
  delays.Add(commands, kOriginAtPowerOn);
  // Marked one by one: each begin of the work, and what follows it.
  std::array<bool, 300> held{};
  for (const faults::DeviceCommand& command : commands) {
    const auto& work = std::get<faults::DelayTask>(command.action);
    for (TimeNs begin = command.at_ns; begin < command.until_ns; begin += work.every_ns)
      for (TimeNs t = begin; t < std::min(begin + work.delay_ns, command.until_ns); ++t)
        held.at(static_cast<std::size_t>(t)) = true;
  }
  for (std::size_t t = 0; t < held.size(); ++t) {
    const auto hold = delays.At(BootTime(static_cast<TimeNs>(t)));
    RC_ASSERT(hold.has_value() == held.at(t));
    if (hold) RC_ASSERT(hold->until > BootTime(static_cast<TimeNs>(t)));
  }
  // Whoever waits as it is told runs as soon as nothing holds it.
  for (std::size_t t = 0; t < held.size(); ++t) {
    BootTime now(static_cast<TimeNs>(t));
    while (const auto hold = delays.At(now)) now = hold->until;
    const auto free = std::find(held.begin() + static_cast<std::ptrdiff_t>(t), held.end(), false);
    RC_ASSERT(now == BootTime(free - held.begin()));
  }
}

}  // namespace
}  // namespace tiltproof::harness
