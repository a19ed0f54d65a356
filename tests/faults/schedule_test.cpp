// Triggers, order, records and edges.

#include "faults/schedule.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

#include "faults/recorder.h"
#include "harness/scenario/shipped_protocols.h"
#include "link/wire.h"
#include "tests/faults/faulty_line.h"
#include "tests/faults/goodness_of_fit.h"

namespace tiltproof::faults {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

std::vector<std::int64_t> Dropped(const FaultSpec& spec, std::int64_t count) {
  std::vector<std::int64_t> dropped;
  const auto out = Send(spec, count);
  for (std::int64_t n = 0; n < count; ++n) {
    if (out[static_cast<std::size_t>(n)].empty()) dropped.push_back(n);
  }
  return dropped;
}

FaultSpec Drop() { return Spec("frame.drop", {{"probability", 1.0}}); }

TEST(ScheduleTest, NoFaultNoFilter) {
  FaultSchedule schedule = AtTheLine({Spec("sensor.freeze", {{"signal", "x_m"}})}, 1);
  EXPECT_EQ(schedule.Filter(link::Direction::kToClient), nullptr);
  EXPECT_EQ(schedule.Filter(link::Direction::kToPlant), nullptr);
  EXPECT_EQ(schedule.Filter(link::Direction::kReference), nullptr);
}

// A fault that is added in flight acts as if it had been there from the start: the same draws, the same counts.
TEST(ScheduleTest, AFaultThatIsAddedActsAsIfItHadBeenThere) {
  FaultSpec first = Spec("frame.drop", {{"probability", 0.2}}, "first");
  FaultSpec added = Spec("wire.bit_error", {{"ber", 0.01}}, "added");
  added.start_ns = 20 * kPeriod;
  added.end_ns = 60 * kPeriod;
  const auto fly = [&](bool late, std::vector<std::int64_t>& counts, bool& active) {
    std::vector<FaultSpec> specs = {first};
    if (!late) specs.push_back(added);
    FaultSchedule schedule = AtTheLine(specs, 7, {.use = {.grows = true}});
    schedule.SetOrigin(kOriginAtPowerOn);
    std::vector<std::vector<link::Chunk>> out;
    for (std::int64_t n = 0; n < 100; ++n) {
      if (late && n == 15) schedule.Add(added);
      std::vector<link::Chunk> chunks = {Frame(n)};
      schedule.Filter(link::Direction::kToClient)->Apply(chunks);
      out.push_back(chunks);
    }
    counts = schedule.ActivationCounts();
    active = schedule.IsActive(1, 20 * kPeriod) && !schedule.IsActive(1, 60 * kPeriod);
    return out;
  };
  std::vector<std::int64_t> counts_late, counts_early;
  bool active_late = false, active_early = false;
  const auto late = fly(true, counts_late, active_late);
  const auto early = fly(false, counts_early, active_early);
  ASSERT_EQ(late.size(), early.size());
  for (std::size_t n = 0; n < late.size(); ++n) {
    ASSERT_EQ(late[n].size(), early[n].size()) << n;
    for (std::size_t i = 0; i < late[n].size(); ++i) EXPECT_EQ(late[n][i].bytes, early[n][i].bytes) << n;
  }
  EXPECT_EQ(counts_late, counts_early);
  EXPECT_GT(counts_late.at(1), 20);
  EXPECT_TRUE(active_late && active_early);
  FaultSchedule schedule = AtTheLine({}, 7, {.use = {.grows = true}});
  EXPECT_THROW(schedule.Add(Spec("frame.dorp")), std::invalid_argument);
}

TEST(ScheduleTest, TheWindowHasItsBeginButNotItsEnd) {
  FaultSpec spec = Drop();
  spec.start_ns = 3 * kPeriod;
  spec.end_ns = 5 * kPeriod;
  EXPECT_THAT(Dropped(spec, 10), ElementsAre(3, 4));
  FaultSchedule schedule = AtTheLine({spec}, 1);
  EXPECT_FALSE(schedule.IsActive(0, 3 * kPeriod - 1));
  EXPECT_TRUE(schedule.IsActive(0, 3 * kPeriod));
  EXPECT_TRUE(schedule.IsActive(0, 5 * kPeriod - 1));
  EXPECT_FALSE(schedule.IsActive(0, 5 * kPeriod));
}

TEST(ScheduleTest, EveryNthCountsFramesInTheWindow) {
  FaultSpec spec = Drop();
  spec.start_ns = 2 * kPeriod;
  spec.every_nth_count = 3;
  EXPECT_THAT(Dropped(spec, 12), ElementsAre(4, 7, 10));
}

TEST(ScheduleTest, ProbabilityHasItsFrequency) {
  FaultSpec spec = Drop();
  spec.probability = 0.25;
  std::vector<bool> dropped(100'000);
  for (const std::int64_t n : Dropped(spec, 100'000)) dropped[static_cast<std::size_t>(n)] = true;
  EXPECT_TRUE(AreBernoulli(dropped, 0.25));
}

TEST(ScheduleTest, OtherMessagesAreNeitherSeenNorCounted) {
  FaultSpec spec = Drop();
  spec.target = Target::kToPlant;
  spec.message = "actuators";
  spec.every_nth_count = 2;
  FaultSchedule schedule = AtTheLine({spec}, 1);
  schedule.SetOrigin(kOriginAtPowerOn);
  std::vector<std::int64_t> dropped;
  for (std::int64_t n = 0; n < 12; ++n) {
    std::vector<link::Chunk> chunks = {Frame(n)};
    chunks[0].message = PlaceInPaper(n % 3 == 0 ? "request" : "actuators");
    schedule.Filter(link::Direction::kToPlant)->Apply(chunks);
    if (chunks.empty()) dropped.push_back(n);
  }
  EXPECT_THAT(dropped, ElementsAre(2, 5, 8, 11));
}

TEST(ScheduleTest, FrameThenByteThenTimingFaultsThenFileOrder) {
  // In the file the other way round: the byte fault must see both copies, the delay must move both.
  const std::vector<FaultSpec> specs = {Spec("frame.delay", {{"mean_ms", 2.0}}, "delay"),
                                        Spec("wire.bit_error", {{"ber", 1.0}}, "errors"),
                                        Spec("frame.truncate", {{"probability", 1.0}}, "cut"),
                                        Spec("frame.duplicate", {{"probability", 1.0}}, "twice")};
  FaultSchedule schedule = AtTheLine(specs, 1);
  const auto out = Send(schedule, 1).at(0);
  ASSERT_THAT(out, SizeIs(2));
  // Cut before it was doubled.
  EXPECT_EQ(out[0].bytes, out[1].bytes);
  EXPECT_LT(out[0].bytes.size(), 68U);
  EXPECT_EQ(out[0].bytes[0], 0x81);
  EXPECT_EQ(out[0].begin_ns, BootTime(2 * kNsPerMs));
  EXPECT_EQ(out[1].begin_ns,
            out[0].begin_ns + link::BytesTime(921'600, static_cast<std::int64_t>(out[0].bytes.size())));
  EXPECT_THAT(schedule.ActivationCounts(), ElementsAre(2, 2, 1, 1));
}

TEST(ScheduleTest, BothDirectionsAddUpInOneCount) {
  FaultSpec spec = Drop();
  spec.target = Target::kBoth;
  FaultSchedule schedule = AtTheLine({spec}, 1);
  Send(schedule, 3, 68, link::Direction::kToClient);
  Send(schedule, 4, 68, link::Direction::kToPlant);
  EXPECT_THAT(schedule.ActivationCounts(), ElementsAre(7));
}

TEST(ScheduleTest, KeepsTheFirstRecordsAndCountsAll) {
  FaultSchedule schedule = AtTheLine({Drop()}, 1);
  Send(schedule, kActivationsMax + 5);
  EXPECT_THAT(schedule.ActivationCounts(), ElementsAre(kActivationsMax + 5));
  EXPECT_THAT(schedule.TakeActivations(kOriginAtPowerOn), SizeIs(kActivationsMax));
  EXPECT_THAT(schedule.TakeActivations(kOriginAtPowerOn), SizeIs(0));
}

TEST(ScheduleTest, RecordsAreInOrderOfTime) {
  FaultSpec bias = Spec("sensor.bias", {{"signal", "x_m"}, {"offset", 0.5}}, "bias");
  FaultSchedule schedule = AtThePlant({bias, Spec("frame.drop", {{"probability", 1.0}}, "drop")}, 1);
  constexpr Origin kOrigin(BootTime{kNsPerS});
  schedule.SetOrigin(kOrigin);
  for (std::int64_t n = 0; n < 3; ++n) {
    std::vector<link::Chunk> chunks = {Frame(n)};
    chunks[0].begin_ns = kOrigin.ToBootTime(FrameTime(n));
    schedule.Filter(link::Direction::kToClient)->Apply(chunks);
  }
  for (std::int64_t n = 0; n < 3; ++n) {
    Sensors sensors{.x_m = 1.25F};
    EditSensors(schedule, n * kPeriod + 1, sensors);
  }
  std::vector<std::pair<TimeNs, std::string>> records;
  for (const Activation& activation : schedule.TakeActivations(kOrigin)) {
    records.emplace_back(activation.time_ns, activation.what);
  }
  using Record = std::pair<TimeNs, std::string>;
  EXPECT_THAT(records,
              ElementsAre(Record{0, "dropped"}, Record{1, "x_m 1.25 -> 1.75"}, Record{kPeriod, "dropped"},
                          Record{kPeriod + 1, "x_m 1.25 -> 1.75"}, Record{2 * kPeriod, "dropped"},
                          Record{2 * kPeriod + 1, "x_m 1.25 -> 1.75"}));
}

TEST(ScheduleTest, InvalidFaultsAreRefusedByName) {
  try {
    FaultSchedule schedule = AtTheLine({Spec("wire.bit_error", {{"ber", 2.0}}, "loud")}, 1);
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), HasSubstr("fault 'loud', parameters.ber: "));
  }
}

FaultSpec Loss(TimeNs start_ns, TimeNs end_ns, double factor, const std::string& id = "loss") {
  FaultSpec spec = Spec("actuator.loss_of_effectiveness", {{"actuator", "f_r"}, {"factor", factor}}, id);
  spec.start_ns = start_ns;
  spec.end_ns = end_ns;
  return spec;
}

TEST(ScheduleTest, ACommandIsEditedInTheStepsOfTheWindow) {
  FaultSchedule schedule = AtThePlant({Loss(10, 30, 0.5)}, 1);
  const ActuatorsTruth command{.f_r_n = 8.0};
  const auto edited = [&](TimeNs t, bool new_command) {
    ActuatorsTruth input = command;
    EditActuators(schedule, t, input, new_command);
    return input.f_r_n;
  };
  EXPECT_EQ(edited(0, true), 8.0);
  EXPECT_EQ(edited(10, false), 4.0);
  EXPECT_EQ(edited(12, false), 4.0);
  EXPECT_EQ(edited(30, false), 8.0);
  // One command, one activation, however often it is applied.
  EXPECT_THAT(schedule.ActivationCounts(), ElementsAre(1));
}

TEST(ScheduleTest, ApplyingACommandAgainIsNotAnotherDraw) {
  FaultSpec spec = Loss(kPowerOn, kNever, 0.5);
  spec.every_nth_count = 2;
  FaultSchedule schedule = AtThePlant({spec}, 1);
  std::vector<double> thrusts;
  for (TimeNs t = 0; t < 8; ++t) {
    ActuatorsTruth input{.f_r_n = 8.0};
    EditActuators(schedule, t, input, t % 2 == 0);
    thrusts.push_back(input.f_r_n);
  }
  EXPECT_THAT(thrusts, ElementsAre(8, 8, 4, 4, 8, 8, 4, 4));
  EXPECT_THAT(schedule.ActivationCounts(), ElementsAre(2));
}

TEST(ScheduleTest, SamplesBeforeTheStartAreInWindowsWithoutABegin) {
  FaultSpec from_power_on = Spec("sensor.bias", {{"signal", "x_m"}, {"offset", 1.0}}, "a");
  FaultSpec from_zero = Spec("sensor.bias", {{"signal", "y_m"}, {"offset", 1.0}}, "b");
  from_zero.start_ns = 0;
  FaultSchedule schedule = AtThePlant({from_power_on, from_zero}, 1);
  Sensors sensors;
  EditSensors(schedule, kPowerOn, sensors);
  EXPECT_EQ(sensors.x_m, 1.0F);
  EXPECT_EQ(sensors.y_m, 0.0F);
}

// Boot time is what there is before the start; the log has it relative to t = 0 like everything else.
TEST(ScheduleTest, RecordsBeforeTheStartHaveNegativeTimes) {
  FaultSchedule schedule = AtThePlant({Spec("sensor.bias", {{"signal", "x_m"}, {"offset", 1.0}})}, 1);
  Sensors sensors;
  EditSensors(schedule, kPowerOn, sensors, BootTime(30 * kNsPerMs));
  EditSensors(schedule, 5, sensors, BootTime(100 * kNsPerMs + 5));
  const std::vector<Activation> activations = schedule.TakeActivations(Origin(BootTime(100 * kNsPerMs)));
  ASSERT_THAT(activations, SizeIs(2));
  EXPECT_EQ(activations[0].time_ns, -70 * kNsPerMs);
  EXPECT_EQ(activations[1].time_ns, 5);
}

// All faults of the line at once, through a wire: what arrives is in order, and the same again.
TEST(ScheduleTest, AWireKeepsOrderUnderEveryFault) {
  std::vector<FaultSpec> specs;
  for (const FaultType& type : FaultTypes()) {
    if (!type.IsOneOf<WireKind>()) continue;
    FaultSpec spec = ExampleSpec(type);
    spec.id = type.name;
    spec.probability = 0.3;
    specs.push_back(spec);
  }
  const auto fly = [&specs] {
    FaultSchedule schedule(specs, 3, {.protocol = harness::FindProtocol("paper")});
    schedule.SetOrigin(kOriginAtPowerOn);
    link::Wire wire({}, link::Direction::kToClient, *harness::FindProtocol("paper"),
                    schedule.Filter(link::Direction::kToClient));
    BootTime free = BootTime::Earliest();
    wire.SetTaps({.sent = {}, .delivered = [&free](const link::Chunk& chunk) {
                    EXPECT_GE(chunk.begin_ns, free);
                    free = chunk.begin_ns +
                           link::BytesTime(921'600, static_cast<std::int64_t>(chunk.bytes.size()));
                  }});
    std::vector<std::pair<BootTime, std::uint8_t>> arrived;
    BootTime last;
    for (std::int64_t n = 0; n < 2000; ++n) {
      const link::Chunk frame = Frame(n);
      wire.Transmit(frame.begin_ns, frame.bytes);
      while (wire.NextArrival() < BootTime((n + 1) * kPeriod)) {
        const BootTime next = wire.NextArrival();
        EXPECT_GE(next, last);
        last = next;
        wire.Take(next, [&arrived](BootTime arrival, std::span<const std::uint8_t> bytes) {
          for (const std::uint8_t byte : bytes) arrived.emplace_back(arrival, byte);
        });
      }
    }
    return arrived;
  };
  const auto first = fly();
  EXPECT_GT(first.size(), 20'000U);
  EXPECT_EQ(first, fly());
}

}  // namespace
}  // namespace tiltproof::faults
