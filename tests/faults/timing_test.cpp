// Every fault of every kind acts when its window, period, condition or the fault that it follows says, and at no
// other time. When that is, each timing says for itself, in periods of 12 ms.
#include <gtest/gtest.h>

#include <functional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "faults/device_command.h"
#include "faults/node_command.h"
#include "tests/faults/faulty_flight.h"

namespace tiltproof::faults {
namespace {

struct Timing {
  std::string name;
  std::function<void(FaultSpec&)> set;
  std::vector<FaultEvent> events;               // heard at their times, of fault 0
  std::function<bool(std::int64_t)> is_active;  // frame, byte, sample or step n, at n * 12 ms
};

const std::vector<Timing>& Timings() {
  static const std::vector<Timing> timings = {
      {"window",
       [](FaultSpec& spec) {
         spec.start_ns = 100 * kPeriod;
         spec.end_ns = 700 * kPeriod;
       },
       {},
       [](std::int64_t n) { return n >= 100 && n < 700; }},
      {"periods",
       [](FaultSpec& spec) {
         spec.start_ns = 100 * kPeriod;
         spec.end_ns = 700 * kPeriod;
         spec.period_ns = 50 * kPeriod;
         spec.duty = 0.5;
       },
       {},
       [](std::int64_t n) { return n >= 100 && n < 700 && n % 50 < 25; }},
      {"level",
       [](FaultSpec& spec) { spec.when = "z_m > 3"; },
       {{FaultEvent::Kind::kConditionHolds, 0, 200 * kPeriod},
        {FaultEvent::Kind::kConditionEnds, 0, 300 * kPeriod},
        {FaultEvent::Kind::kConditionHolds, 0, 500 * kPeriod},
        {FaultEvent::Kind::kConditionEnds, 0, 560 * kPeriod}},
       [](std::int64_t n) { return (n >= 200 && n < 300) || (n >= 500 && n < 560); }},
      {"edge",
       [](FaultSpec& spec) {
         spec.when = "z_m > 3";
         spec.edge = Edge::kRising;
         spec.end_ns = 600 * kPeriod;
       },
       {{FaultEvent::Kind::kConditionHolds, 0, 200 * kPeriod},
        {FaultEvent::Kind::kConditionEnds, 0, 300 * kPeriod}},
       [](std::int64_t n) { return n >= 200 && n < 600; }},
      {"after",
       [](FaultSpec& spec) {
         spec.after = After{"other", 10 * kPeriod};
         spec.period_ns = 40 * kPeriod;
         spec.duty = 0.5;
       },
       {{FaultEvent::Kind::kFirstActivation, 1, 150 * kPeriod}},
       [](std::int64_t n) { return n >= 160 && (n - 160) % 40 < 20; }},
      {"all at once",
       [](FaultSpec& spec) {
         spec.start_ns = 100 * kPeriod;
         spec.end_ns = 900 * kPeriod;
         spec.period_ns = 60 * kPeriod;
         spec.duty = 0.5;
         spec.when = "z_m > 3";
         spec.after = After{"other", 0};
       },
       {{FaultEvent::Kind::kConditionHolds, 0, 120 * kPeriod},
        {FaultEvent::Kind::kFirstActivation, 1, 170 * kPeriod},
        {FaultEvent::Kind::kConditionEnds, 0, 600 * kPeriod}},
       [](std::int64_t n) { return n >= 170 && n < 600 && (n - 100) % 60 < 30; }},
  };
  return timings;
}

std::vector<FaultType> TypesThat(bool are_commands) {
  std::vector<FaultType> types;
  for (const FaultType& type : FaultTypes())
    if (type.is_command() == are_commands) types.push_back(type);
  return types;
}

// One period of a flight: a frame, the same bytes at the receiver, a sample, a step. Whether anything is not as it was.
bool PassOne(FaultSchedule& schedule, std::int64_t n) {
  const TimeNs t = n * kPeriod;
  bool changed = false;
  if (link::ChunkFilter* filter = schedule.Filter(link::Direction::kToClient)) {
    std::vector<link::Chunk> chunks = {Frame(n)};
    filter->Apply(chunks);
    changed = !Unchanged(chunks, n) || !schedule.TakeSentBack(link::Direction::kToClient).empty();
  }
  const Bytes bytes = Frame(n).bytes;
  std::vector<ReceiveMark> marks;
  const TimeNs length_ns = link::BytesTime(921'600, static_cast<std::int64_t>(bytes.size()));
  schedule.MarkReceived(link::Direction::kToClient, BootTime(t) + length_ns, bytes, marks);
  for (const ReceiveMark mark : marks) changed = changed || mark != ReceiveMark{};
  Sensors sensors = Sample(n);
  EditSensors(schedule, t, sensors);
  ActuatorsTruth input = Command(n);
  EditActuators(schedule, t, input);
  return changed || sensors != Sample(n) || input != Command(n) || schedule.DisturbanceOf(t) != Disturbance{};
}

// In which periods of a flight the fault acted: it counted an activation, and something had changed. A disturbance
// of the vehicle counts once, when it begins.
std::vector<bool> Acted(const FaultSpec& spec, std::vector<FaultEvent> events) {
  const bool shows = spec.type != "harness.null", is_lasting = spec.type.starts_with("plant.");
  // The other never acts by itself: on no line that is used.
  FaultSpec other = Spec("frame.drop", {{"probability", 1.0}}, "other");
  other.target = Target::kReference;
  FaultSchedule schedule = AtThePlant({spec, other});
  schedule.SetOrigin(kOriginAtPowerOn);
  std::vector<bool> acted;
  for (std::int64_t n = 0; n < kFrames; ++n) {
    while (!events.empty() && events.front().time_ns <= n * kPeriod) {
      schedule.Hear(std::vector<FaultEvent>{events.front()});
      events.erase(events.begin());
    }
    const std::int64_t before = schedule.ActivationCounts().at(0);
    const bool changed = PassOne(schedule, n);
    const bool counted = schedule.ActivationCounts().at(0) > before;
    acted.push_back(is_lasting ? changed : counted);
    EXPECT_TRUE(changed || !shows || !counted) << n;
  }
  return acted;
}

class TimingTest : public ::testing::TestWithParam<FaultType> {
 protected:
  const FaultType& type() const { return GetParam(); }
};

TEST_P(TimingTest, ActsInItsTimeAlone) {
  // These act on all that comes in their time; others draw, or leave alone what looks right to them.
  static const std::set<std::string_view> kAlways = {
      "harness.null",    "link.silence", "link.disconnect",    "frame.drop",  "frame.duplicate",
      "frame.truncate",  "uart.overrun", "uart.framing_error", "sensor.bias", "sensor.stuck_at",
      "actuator.offset", "plant.force",  "plant.mass",         "plant.thrust"};
  for (const Timing& timing : Timings()) {
    FaultSpec spec = ExampleSpec(type());
    if (kAlways.contains(type().name) && spec.parameters.contains("probability"))
      spec.parameters["probability"] = 1.0;
    timing.set(spec);
    const std::vector<bool> acted = Acted(spec, timing.events);
    int inside = 0;
    for (std::int64_t n = 0; n < kFrames; ++n) {
      const bool acts = acted[static_cast<std::size_t>(n)];
      inside += acts ? 1 : 0;
      ASSERT_TRUE(!acts || timing.is_active(n)) << timing.name << " " << n;
      ASSERT_TRUE(acts || !timing.is_active(n) || !kAlways.contains(type().name)) << timing.name << " " << n;
    }
    EXPECT_GT(inside, 0) << timing.name;
  }
}

INSTANTIATE_TEST_SUITE_P(All, TimingTest, ::testing::ValuesIn(TypesThat(false)), TestName);

class CommandTimingTest : public TimingTest {};

// Begin and end of every command.
std::vector<std::pair<TimeNs, TimeNs>> CommandsOf(const FaultSpec& spec) {
  std::vector<std::pair<TimeNs, TimeNs>> times;
  for (const NodeCommand& command : NodeCommands({spec})) times.emplace_back(command.at_ns, command.until_ns);
  if (times.empty())
    for (const DeviceCommand& command : DeviceCommands({spec}, 1))
      times.emplace_back(command.at_ns, command.until_ns);
  return times;
}

TEST_P(CommandTimingTest, IsGivenInEachPeriodOrTakesNone) {
  FaultSpec spec = ExampleSpec(type());
  spec.start_ns = kNsPerS;
  if (type().end != Bound::kRefused) spec.end_ns = 3 * kNsPerS + 5 * kNsPerMs;
  spec.period_ns = kNsPerS;
  spec.duty = 0.25;
  if (type().start == Bound::kRefused || type().end == Bound::kRefused || type().happens_once()) {
    EXPECT_FALSE(Validate(spec).empty());
    return;
  }
  ASSERT_TRUE(Validate(spec).empty()) << Validate(spec).front().message;
  const std::vector<std::pair<TimeNs, TimeNs>> expected = {
      {kNsPerS, 1250 * kNsPerMs}, {2 * kNsPerS, 2250 * kNsPerMs}, {3 * kNsPerS, 3005 * kNsPerMs}};
  EXPECT_EQ(CommandsOf(spec), expected);
}

TEST_P(CommandTimingTest, WaitsForNothing) {
  FaultSpec spec = ExampleSpec(type());
  ASSERT_TRUE(Validate(spec).empty());
  FaultSpec conditional = spec, following = spec;
  conditional.when = "z_m > 1";
  following.after = After{"other", 0};
  EXPECT_EQ(Validate(conditional).at(0).key, "when");
  EXPECT_EQ(Validate(following).at(0).key, "after");
}

TEST_P(CommandTimingTest, OthersFollowIt) {
  const FaultSpec spec = ExampleSpec(type());
  FaultSpec follower = Spec("sensor.bias", {{"signal", "x_m"}, {"offset", 1.0}}, "follower");
  follower.after = After{spec.id, 7 * kNsPerMs};
  FaultSchedule schedule = AtThePlant({spec, follower});
  schedule.SetOrigin(kOriginAtPowerOn);
  EXPECT_FALSE(schedule.IsActive(1, 10 * kNsPerS));
  schedule.Count(0, 3 * kNsPerS, "carried out");
  EXPECT_EQ(schedule.PollEvents(),
            std::vector({FaultEvent{FaultEvent::Kind::kFirstActivation, 0, 3 * kNsPerS}}));
  schedule.Count(0, 4 * kNsPerS, "carried out again");
  EXPECT_TRUE(schedule.PollEvents().empty());
  EXPECT_FALSE(schedule.IsActive(1, 3 * kNsPerS + 7 * kNsPerMs - 1));
  EXPECT_TRUE(schedule.IsActive(1, 3 * kNsPerS + 7 * kNsPerMs));
}

INSTANTIATE_TEST_SUITE_P(All, CommandTimingTest, ::testing::ValuesIn(TypesThat(true)), TestName);

}  // namespace
}  // namespace tiltproof::faults
