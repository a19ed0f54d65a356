// When faults are active, against every nanosecond looked at one by one.

#include "faults/activity.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "faults/device_command.h"
#include "faults/node_command.h"
#include "tests/faults/faulty_line.h"
#include "tests/faults/says.h"

namespace tiltproof::faults {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

// The definition, in parts of the period small enough for a double to be exact.
bool IsActive(const FaultSpec& spec, TimeNs t) {
  if (t < spec.start_ns || t >= spec.end_ns) return false;
  TimeNs phase = t - spec.start_ns;
  while (phase >= spec.period_ns) phase -= spec.period_ns;
  return static_cast<double>(phase) < static_cast<double>(spec.period_ns) * *spec.duty;
}

// A window of some hundred nanoseconds with periods of eighths.
FaultSpec DrawPeriodic() {
  FaultSpec spec = Spec("frame.drop", {{"probability", 1.0}});
  spec.start_ns = *rc::gen::inRange<TimeNs>(-50, 50);
  spec.end_ns = *rc::gen::arbitrary<bool>() ? kNever : spec.start_ns + *rc::gen::inRange<TimeNs>(1, 200);
  spec.period_ns = 8 * *rc::gen::inRange<TimeNs>(1, 10);
  spec.duty = static_cast<double>(*rc::gen::inRange(1, 9)) / 8;
  return spec;
}

RC_GTEST_PROP(ActivityTest, FollowsItsDefinitionAtEveryNanosecond, ()) {
  const FaultSpec spec = DrawPeriodic();
  const Activity activity(spec, {spec.start_ns, spec.end_ns});
  for (TimeNs t = -60; t < 300; ++t) RC_ASSERT(activity.Contains(t) == IsActive(spec, t));
}

RC_GTEST_PROP(ActivityTest, TouchesWhatHasAnActiveNanosecond, ()) {
  const FaultSpec spec = DrawPeriodic();
  const Activity activity(spec, {spec.start_ns, spec.end_ns});
  const auto begin = *rc::gen::inRange<TimeNs>(-60, 300);
  const TimeNs end = begin + *rc::gen::inRange<TimeNs>(0, 100);
  bool touches = IsActive(spec, begin);
  for (TimeNs t = begin; t < end; ++t) touches = touches || IsActive(spec, t);
  RC_ASSERT(activity.Touches(begin, end) == touches);
}

RC_GTEST_PROP(ActivityTest, TheNextEdgeIsWhereTheAnswerChanges, ()) {
  const FaultSpec spec = DrawPeriodic();
  const Activity activity(spec, {spec.start_ns, spec.end_ns});
  const auto t = *rc::gen::inRange<TimeNs>(-60, 300);
  TimeNs edge = t + 1;
  while (edge < 1000 && IsActive(spec, edge) == IsActive(spec, t)) ++edge;
  RC_ASSERT(activity.NextEdge(t) == (edge < 1000 ? edge : kNever));
}

RC_GTEST_PROP(ActivityTest, StretchesAreAllThatIsActive, ()) {
  FaultSpec spec = DrawPeriodic();
  spec.end_ns = spec.start_ns + *rc::gen::inRange<TimeNs>(1, 300);
  const Activity activity(spec, {spec.start_ns, spec.end_ns});
  std::vector<bool> active(500, false);
  for (const Window& stretch : activity.Stretches())
    for (TimeNs t = stretch.begin_ns; t < stretch.end_ns; ++t)
      active[static_cast<std::size_t>(t + 60)] = true;
  for (TimeNs t = -60; t < 440; ++t) RC_ASSERT(active[static_cast<std::size_t>(t + 60)] == IsActive(spec, t));
}

// A fault with its triggers, and the events that happened.
struct Waiting {
  FaultSpec spec;
  std::optional<TimeNs> followed;  // first activation of the fault that it follows
  std::vector<TimeNs> changes;     // of its condition: true from the first on, false from the second ...
};

Waiting DrawWaiting() {
  Waiting waiting{DrawPeriodic(), {}, {}};
  FaultSpec& spec = waiting.spec;
  if (*rc::gen::arbitrary<bool>()) {
    spec.period_ns = kNever;
    spec.duty.reset();
  }
  if (*rc::gen::arbitrary<bool>()) {
    spec.after = After{"other", *rc::gen::inRange<TimeNs>(0, 40)};
    if (*rc::gen::arbitrary<bool>()) waiting.followed = *rc::gen::inRange<TimeNs>(-60, 150);
    if (*rc::gen::arbitrary<bool>()) spec.start_ns = kPowerOn;
  }
  if (*rc::gen::arbitrary<bool>()) {
    spec.when = "condition";
    spec.edge = *rc::gen::element(Edge::kLevel, Edge::kRising);
    TimeNs t = -60;
    const auto count = *rc::gen::inRange(0, 12);
    for (int i = 0; i < count; ++i) waiting.changes.push_back(t += *rc::gen::inRange<TimeNs>(1, 40));
  }
  return waiting;
}

// The definition, for one nanosecond.
bool IsActive(const Waiting& waiting, TimeNs t) {
  const FaultSpec& spec = waiting.spec;
  if (spec.after && !waiting.followed) return false;
  const TimeNs opened = spec.after ? *waiting.followed + spec.after->delay_ns : kPowerOn;
  const auto in_window = [&](TimeNs at) { return at >= spec.start_ns && at >= opened && at < spec.end_ns; };
  if (!in_window(t)) return false;
  if (spec.period_ns != kNever) {
    TimeNs phase = t - (spec.start_ns == kPowerOn ? opened : spec.start_ns);
    while (phase >= spec.period_ns) phase -= spec.period_ns;
    if (static_cast<double>(phase) >= static_cast<double>(spec.period_ns) * *spec.duty) return false;
  }
  if (spec.when.empty()) return true;
  bool holds = false, has_risen = false;
  for (const TimeNs change : waiting.changes) {
    if (change > t) break;
    holds = !holds;
    has_risen = has_risen || (holds && in_window(change));
  }
  return spec.edge == Edge::kRising ? has_risen : holds;
}

// Told in order of time, as a flight does.
Activity Told(const Waiting& waiting) {
  const FaultSpec& spec = waiting.spec;
  Activity activity(spec, {spec.start_ns, spec.end_ns});
  bool holds = false, followed = !waiting.followed;
  const auto follow_by = [&](TimeNs t) {
    if (!followed && *waiting.followed <= t) {
      activity.OnFollowed(*waiting.followed);
      followed = true;
    }
  };
  for (const TimeNs change : waiting.changes) {
    follow_by(change);
    activity.OnCondition(change, holds = !holds);
  }
  follow_by(kNever);
  return activity;
}

RC_GTEST_PROP(ActivityTest, WaitingFaultsFollowTheirDefinitionAtEveryNanosecond, ()) {
  const Waiting waiting = DrawWaiting();
  const Activity activity = Told(waiting);
  for (TimeNs t = -60; t < 400; ++t) RC_ASSERT(activity.Contains(t) == IsActive(waiting, t));
  RC_ASSERT(activity.Contains(kPowerOn) ==
            (waiting.spec.start_ns == kPowerOn && !WaitsForEvent(waiting.spec)));
}

RC_GTEST_PROP(ActivityTest, WaitingFaultsTouchWhatHasAnActiveNanosecond, ()) {
  const Waiting waiting = DrawWaiting();
  const Activity activity = Told(waiting);
  const auto begin = *rc::gen::inRange<TimeNs>(-60, 300);
  const TimeNs end = begin + *rc::gen::inRange<TimeNs>(0, 100);
  bool touches = IsActive(waiting, begin);
  for (TimeNs t = begin; t < end; ++t) touches = touches || IsActive(waiting, t);
  RC_ASSERT(activity.Touches(begin, end) == touches);
}

RC_GTEST_PROP(ActivityTest, NoChangeIsBetweenTwoEdges, ()) {
  const Waiting waiting = DrawWaiting();
  const Activity activity = Told(waiting);
  const auto t = *rc::gen::inRange<TimeNs>(-60, 300);
  const TimeNs edge = std::min<TimeNs>(activity.NextEdge(t), 500);
  RC_ASSERT(edge > t);
  for (TimeNs between = t; between < edge; ++between)
    RC_ASSERT(IsActive(waiting, between) == IsActive(waiting, t));
}

RC_GTEST_PROP(ActivityTest, TheSpanEndsWithTheLastStretch, ()) {
  FaultSpec spec = DrawPeriodic();
  spec.end_ns = spec.start_ns + *rc::gen::inRange<TimeNs>(1, 300);
  const Activity activity(spec, {spec.start_ns, spec.end_ns});
  RC_ASSERT(activity.Span().begin_ns == spec.start_ns);
  RC_ASSERT(activity.Span().end_ns == activity.Stretches().back().end_ns);
}

// Conditions and activations reach a schedule as events; each part tells what others wait for.
TEST(ActivityTest, SchedulesTellWhatOthersWaitFor) {
  FaultSpec first = Spec("frame.drop", {{"probability", 1.0}}, "first");
  first.start_ns = FrameTime(3);
  FaultSpec second = Spec("sensor.bias", {{"signal", "x_m"}, {"offset", 1.0}}, "second");
  second.after = After{"first", 5 * kNsPerMs};
  FaultSpec third = Spec("sensor.bias", {{"signal", "y_m"}, {"offset", 1.0}}, "third");
  third.when = "z_m > 1";
  const std::vector<FaultSpec> specs = {first, second, third};
  FaultSchedule line = AtTheLine(specs, 1), plant = AtThePlant(specs);
  constexpr Origin kOrigin(BootTime(7));
  line.SetOrigin(kOrigin);
  for (std::int64_t n = 0; n < 6; ++n) {
    std::vector<link::Chunk> chunks = {Frame(n)};
    chunks[0].begin_ns = kOrigin.ToBootTime(FrameTime(n));
    line.Filter(link::Direction::kToClient)->Apply(chunks);
  }
  const std::vector<FaultEvent> events = line.PollEvents();
  EXPECT_THAT(events, ElementsAre(FaultEvent{FaultEvent::Kind::kFirstActivation, 0, FrameTime(3)}));
  EXPECT_THAT(line.PollEvents(), IsEmpty());
  const TimeNs opens = FrameTime(3) + 5 * kNsPerMs;
  EXPECT_FALSE(plant.IsActive(1, opens));
  plant.Hear(events);
  for (const FaultSchedule* schedule : {&line, &plant}) {
    EXPECT_FALSE(schedule->IsActive(1, opens - 1));
    EXPECT_TRUE(schedule->IsActive(1, opens));
  }
  plant.Hear(std::vector<FaultEvent>{{FaultEvent::Kind::kConditionHolds, 2, 10},
                                     {FaultEvent::Kind::kConditionEnds, 2, 20}});
  Sensors sensors{};
  EditSensors(plant, 15, sensors);
  EXPECT_EQ(sensors.y_m, 1.0F);
  EditSensors(plant, 20, sensors);
  EXPECT_EQ(sensors.y_m, 1.0F);
  EXPECT_THROW(AtTheLine({second}, 1), std::invalid_argument);
}

TEST(ActivityTest, PeriodsDoNotDrift) {
  FaultSpec spec = Spec("link.silence");
  spec.start_ns = 1;
  spec.period_ns = 333'333'333;
  spec.duty = 0.3;
  const Activity activity(spec, {spec.start_ns, kNever});
  const TimeNs begin = 1 + 250'000 * spec.period_ns;  // after a day
  EXPECT_FALSE(activity.Contains(begin - 1));
  EXPECT_TRUE(activity.Contains(begin));
  EXPECT_TRUE(activity.Contains(begin + 99'999'999));
  EXPECT_FALSE(activity.Contains(begin + 100'000'000));
}

// As many faults as there are periods do the same, where no draw is involved.
TEST(ActivityTest, APeriodicFaultIsTheUnionOfItsStretches) {
  constexpr TimeNs kByte = 10'851;
  for (const char* type : {"link.silence", "link.disconnect"}) {
    FaultSpec periodic = Spec(type);
    periodic.start_ns = FrameTime(2) + 20 * kByte;
    periodic.end_ns = FrameTime(60) + 10 * kByte;
    for (const TimeNs period_ns : {15 * kByte, 13 * kNsPerMs, 31 * kNsPerMs}) {
      periodic.period_ns = period_ns;
      periodic.duty = 0.4;
      std::vector<FaultSpec> single;
      for (TimeNs begin = periodic.start_ns; begin < periodic.end_ns; begin += period_ns) {
        single.push_back(Spec(type, {}, "fault" + std::to_string(single.size())));
        single.back().start_ns = begin;
        single.back().end_ns = std::min(begin + period_ns * 2 / 5, periodic.end_ns);
      }
      FaultSchedule one = AtTheLine({periodic}, 1), many = AtTheLine(single, 1);
      const auto expected = Send(many, 70), out = Send(one, 70);
      int changed = 0;
      for (std::size_t n = 0; n < out.size(); ++n) {
        // Bytes and their times; where a piece ends matters not.
        const auto flat = [](const std::vector<link::Chunk>& chunks) {
          std::vector<std::uint8_t> bytes;
          for (const auto& chunk : chunks) bytes.insert(bytes.end(), chunk.bytes.begin(), chunk.bytes.end());
          return bytes;
        };
        EXPECT_EQ(flat(out[n]), flat(expected[n])) << type << " " << period_ns << " " << n;
        if (flat(out[n]) != Frame(static_cast<std::int64_t>(n)).bytes) ++changed;
      }
      EXPECT_GT(changed, 10) << type << " " << period_ns;
      EXPECT_EQ(one.ActivationCounts().at(0), changed);
    }
  }
}

// It draws for a frame what it would draw without periods.
TEST(ActivityTest, APeriodicFaultKeepsItsStream) {
  FaultSpec steady = Spec("wire.bit_error", {{"ber", 0.01}});
  FaultSpec periodic = steady;
  periodic.start_ns = 0;
  periodic.period_ns = 48 * kNsPerMs;
  periodic.duty = 0.5;
  const auto all = Send(steady, 100), some = Send(periodic, 100);
  for (std::size_t n = 0; n < all.size(); ++n) {
    if (n % 4 < 2)
      EXPECT_TRUE(Same(some[n], all[n])) << n;
    else
      EXPECT_TRUE(Unchanged(some[n], static_cast<std::int64_t>(n))) << n;
  }
}

TEST(ActivityTest, AnActuatorFaultComesAndGoesWithItsPeriods) {
  FaultSpec loss = Spec("actuator.loss_of_effectiveness", {{"actuator", "f_r"}, {"factor", 0.5}});
  loss.start_ns = 10;
  loss.end_ns = 100;
  loss.period_ns = 40;
  loss.duty = 0.25;
  FaultSchedule schedule = AtThePlant({loss}, 1);
  std::vector<TimeNs> lossy;
  for (TimeNs t = 0; t < 120; t += 5) {
    ActuatorsTruth input{.f_r_n = 8};
    EditActuators(schedule, t, input);
    if (input.f_r_n == 4) lossy.push_back(t);
  }
  EXPECT_THAT(lossy, ElementsAre(10, 15, 50, 55, 90, 95));
  EXPECT_TRUE(schedule.IsActive(0, 55));
  EXPECT_FALSE(schedule.IsActive(0, 60));
}

TEST(ActivityTest, ACommandThatIsTakenBackIsGivenInEveryPeriod) {
  FaultSpec pause = Spec("node.pause", {{"node", "client"}});
  pause.start_ns = kNsPerS;
  pause.end_ns = 3 * kNsPerS + kNsPerMs;
  pause.period_ns = kNsPerS;
  pause.duty = 0.1;
  std::vector<std::pair<TimeNs, TimeNs>> times;
  for (const NodeCommand& command : NodeCommands({pause}))
    times.emplace_back(command.at_ns, command.until_ns);
  EXPECT_THAT(times, ElementsAre(std::pair(kNsPerS, kNsPerS + 100 * kNsPerMs),
                                 std::pair(2 * kNsPerS, 2 * kNsPerS + 100 * kNsPerMs),
                                 std::pair(3 * kNsPerS, 3 * kNsPerS + kNsPerMs)));
}

TEST(ActivityTest, ValidateRefusesPeriodsThatMeanNothing) {
  FaultSpec spec = Spec("link.silence");
  spec.duty = 0.5;
  EXPECT_THAT(Validate(spec), Says("duty", "needs period_s"));
  spec.period_ns = kNsPerS;
  EXPECT_THAT(Validate(spec), Says("period_s", "needs start_s"));
  spec.start_ns = 0;
  EXPECT_THAT(Validate(spec), IsEmpty());
  for (const double duty : {0.0, -0.1, 1.1, std::nan("")}) {
    spec.duty = duty;
    EXPECT_THAT(Validate(spec), Says("duty", "at most 1"));
  }
  spec.duty.reset();
  EXPECT_THAT(Validate(spec), Says("period_s", "needs duty"));
}

TEST(ActivityTest, ValidateRefusesPeriodsOfWhatHappensOnce) {
  FaultSpec kill = Spec("node.kill", {{"node", "client"}});
  kill.start_ns = 0;
  kill.period_ns = kNsPerS;
  kill.duty = 0.5;
  EXPECT_THAT(Validate(kill), Says("period_s", "happens once"));
  FaultSpec pause = Spec("node.pause", {{"node", "client"}});
  pause.start_ns = 0;
  pause.end_ns = 10 * kNsPerS;
  pause.period_ns = kNsPerMs;
  pause.duty = 0.5;
  EXPECT_THAT(Validate(pause), ::testing::IsEmpty());
  pause.end_ns = 20 * kNsPerS + 1;
  EXPECT_THAT(Validate(pause), Says("period_s", "more than 20000 commands"));
}

TEST(ActivityTest, ValidateRefusesWaitingThatMeansNothing) {
  FaultSpec spec = Spec("link.silence");
  spec.edge = Edge::kRising;
  EXPECT_THAT(Validate(spec), Says("edge", "needs when"));
  spec.when = "z_m > 1";
  EXPECT_THAT(Validate(spec), IsEmpty());
  spec.after = After{"fault", 0};
  EXPECT_THAT(Validate(spec), Says("after.fault", "itself"));
  spec.after = After{"other", -1};
  EXPECT_THAT(Validate(spec), Says("after.delay_s", "at least 0"));
  FaultSpec pause = Spec("node.pause", {{"node", "client"}});
  pause.start_ns = 0;
  pause.end_ns = kNsPerS;
  pause.when = "z_m > 1";
  EXPECT_THAT(Validate(pause), Says("when", "planned before the flight"));
  pause.when.clear();
  pause.after = After{"other", 0};
  EXPECT_THAT(Validate(pause), Says("after", "planned before the flight"));
}

}  // namespace
}  // namespace tiltproof::faults
