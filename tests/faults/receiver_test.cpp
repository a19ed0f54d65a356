// Marks that faults give to bytes as they arrive at the firmware's receiver.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <string>
#include <vector>

#include "faults/schedule.h"
#include "tests/faults/faulty_line.h"
#include "tests/faults/goodness_of_fit.h"

namespace tiltproof::faults {
namespace {

using link::Direction;
using ::testing::Contains;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::Field;
using ::testing::IsEmpty;
using ::testing::SizeIs;

using Marks = std::vector<ReceiveMark>;

Bytes Frame68(std::int64_t n) { return Frame(n).bytes; }

// One frame of 68 bytes every 12 ms, its last byte at n * 12 ms, in pieces of at most `piece` bytes.
Marks Receive(FaultSchedule& schedule, std::int64_t frames, std::size_t piece = 68,
              Direction direction = Direction::kToClient) {
  Marks all, marks;
  for (std::int64_t n = 0; n < frames; ++n) {
    const Bytes bytes = Frame68(n);
    for (std::size_t begin = 0; begin < bytes.size(); begin += piece) {
      const std::size_t end = std::min(begin + piece, bytes.size());
      const BootTime arrival =
          BootTime(n * kPeriod) - link::BytesTime(921'600, static_cast<std::int64_t>(bytes.size() - end));
      schedule.MarkReceived(direction, arrival, std::span(bytes).subspan(begin, end - begin), marks);
      EXPECT_THAT(marks, SizeIs(end - begin));
      all.insert(all.end(), marks.begin(), marks.end());
    }
  }
  return all;
}

Marks Receive(const std::vector<FaultSpec>& specs, std::int64_t frames, std::uint64_t seed = 1) {
  FaultSchedule schedule = AtTheLine(specs, seed);
  schedule.SetOrigin(kOriginAtPowerOn);
  return Receive(schedule, frames);
}

class ReceiverConformanceTest : public ::testing::TestWithParam<FaultType> {
 protected:
  const FaultType& type() const { return GetParam(); }
  ReceiveMark mark() const { return type().As<ReceiverKind>()->mark; }
  FaultSpec With(double probability, const std::string& id = "fault") const {
    return Spec(std::string(type().name), {{"probability", probability}}, id);
  }
};

TEST_P(ReceiverConformanceTest, MarksItsShareOfBytesEachForItself) {
  const double p = 0.15;
  const Marks marks = Receive({With(p)}, 10'000);
  std::vector<bool> marked;
  for (const ReceiveMark each : marks) {
    marked.push_back(each != ReceiveMark::kNone);
    if (marked.back()) {
      ASSERT_EQ(each, mark());
    }
  }
  EXPECT_TRUE(AreBernoulli(marked, p));  // of 680 000
}

TEST_P(ReceiverConformanceTest, ZeroMarksNothingAndOneMarksAll) {
  FaultSchedule none = AtTheLine({With(0.0)}, 1);
  none.SetOrigin(kOriginAtPowerOn);
  EXPECT_THAT(Receive(none, 50), Each(ReceiveMark::kNone));
  EXPECT_THAT(none.ActivationCounts(), ElementsAre(0));
  EXPECT_THAT(Receive({With(1.0)}, 50), Each(mark()));
}

TEST_P(ReceiverConformanceTest, EditsNeitherFramesNorValues) {
  FaultSchedule schedule = AtThePlant({With(1.0)}, 1);
  schedule.SetOrigin(kOriginAtPowerOn);
  for (const auto direction : {Direction::kToClient, Direction::kToPlant, Direction::kReference})
    EXPECT_EQ(schedule.Filter(direction), nullptr);
  Sensors sensors{.x_m = 1.25F};
  EditSensors(schedule, 0, sensors);
  EXPECT_EQ(sensors, Sensors{.x_m = 1.25F});
}

TEST_P(ReceiverConformanceTest, HowBytesAreSpreadOverCallsMattersNot) {
  FaultSpec spec = With(0.1);
  spec.every_nth_count = 3;
  spec.probability = 0.5;
  const auto receive = [&](std::size_t piece) {
    FaultSchedule schedule = AtTheLine({spec}, 3);
    schedule.SetOrigin(kOriginAtPowerOn);
    Marks marks = Receive(schedule, 300, piece);
    return std::pair(marks, schedule.ActivationCounts().at(0));
  };
  const auto whole = receive(68);
  EXPECT_GT(whole.second, 20);
  EXPECT_EQ(receive(1), whole);
  EXPECT_EQ(receive(13), whole);
}

TEST_P(ReceiverConformanceTest, SameSeedSameMarks) {
  EXPECT_EQ(Receive({With(0.1)}, 100, 5), Receive({With(0.1)}, 100, 5));
  EXPECT_NE(Receive({With(0.1)}, 100, 5), Receive({With(0.1)}, 100, 6));
  EXPECT_NE(Receive({With(0.1)}, 100, 5), Receive({With(0.1, "another")}, 100, 5));
}

TEST_P(ReceiverConformanceTest, AnotherFaultDoesNotShiftItsDraws) {
  const Marks alone = Receive({With(0.05)}, 200);
  const FaultSpec other = Spec("uart.noise_error", {{"probability", 0.5}}, "other");
  const Marks after = Receive({With(0.05), other}, 200);
  const Marks before = Receive({other, With(0.05)}, 200);
  const Marks other_alone = Receive({other}, 200);
  for (std::size_t i = 0; i < alone.size(); ++i) {
    // The first in the file has the byte.
    ASSERT_EQ(after[i], alone[i] != ReceiveMark::kNone ? alone[i] : other_alone[i]) << i;
    ASSERT_EQ(before[i], other_alone[i] != ReceiveMark::kNone ? other_alone[i] : alone[i]) << i;
  }
}

TEST_P(ReceiverConformanceTest, TheWindowIsByEachBytesArrival) {
  // Bytes of frame 100 end at 1.2 s; the window opens with its byte 60 and closes before the last of frame 101.
  const TimeNs begin = 100 * kPeriod - link::BytesTime(921'600, 7);
  const TimeNs end = 101 * kPeriod;
  const Marks marks = Receive({At(With(1.0), begin, end)}, 200);
  for (std::size_t i = 0; i < marks.size(); ++i) {
    const bool inside = i >= 100 * 68 + 60 && i < 101 * 68 + 67;
    ASSERT_EQ(marks[i], inside ? mark() : ReceiveMark::kNone) << i;
  }
}

TEST_P(ReceiverConformanceTest, WindowsAreInSimulationTimeAndOpenFromPowerOnOnlyWithoutAStart) {
  FaultSchedule open = AtTheLine({With(1.0)}, 1);
  EXPECT_THAT(Receive(open, 5), Each(mark()));
  FaultSchedule closed = AtTheLine({At(With(1.0), 0)}, 1);
  EXPECT_THAT(Receive(closed, 5), Each(ReceiveMark::kNone));
  FaultSchedule from_zero = AtTheLine({At(With(1.0), 0)}, 1);
  constexpr Origin kOrigin(BootTime{3 * kPeriod});
  from_zero.SetOrigin(kOrigin);
  const Marks marks = Receive(from_zero, 5);
  EXPECT_EQ(std::count(marks.begin(), marks.end(), mark()), 68 + 1);
  const auto activations = from_zero.TakeActivations(kOrigin);
  ASSERT_THAT(activations, SizeIs(69));
  EXPECT_EQ(activations[0].time_ns, 0);
  EXPECT_EQ(activations.back().time_ns, kPeriod);
}

TEST_P(ReceiverConformanceTest, LinesAreSeparate) {
  FaultSpec spec = With(0.5);
  const auto receive = [&](Target target, Direction direction) {
    spec.target = target;
    FaultSchedule schedule = AtTheLine({spec}, 1);
    schedule.SetOrigin(kOriginAtPowerOn);
    if (direction != Direction::kToClient) Receive(schedule, 3);  // bytes of the other line shift nothing
    return Receive(schedule, 50, 68, direction);
  };
  const Marks main = receive(Target::kToClient, Direction::kToClient);
  EXPECT_EQ(main, receive(Target::kNone, Direction::kToClient));
  EXPECT_THAT(receive(Target::kReference, Direction::kToClient), Each(ReceiveMark::kNone));
  EXPECT_THAT(receive(Target::kToClient, Direction::kReference), Each(ReceiveMark::kNone));
  const Marks reference = receive(Target::kReference, Direction::kReference);
  EXPECT_THAT(reference, Contains(mark()));
}

TEST_P(ReceiverConformanceTest, RecordsEveryMarkedByte) {
  FaultSchedule schedule = AtTheLine({With(0.05)}, 1);
  schedule.SetOrigin(kOriginAtPowerOn);
  const Marks marks = Receive(schedule, 20);
  const auto count = static_cast<std::size_t>(std::count(marks.begin(), marks.end(), mark()));
  EXPECT_GT(count, 20U);
  EXPECT_THAT(schedule.ActivationCounts(), ElementsAre(static_cast<std::int64_t>(count)));
  const auto activations = schedule.TakeActivations(kOriginAtPowerOn);
  ASSERT_THAT(activations, SizeIs(count));
  std::size_t record = 0;
  for (std::size_t i = 0; i < marks.size(); ++i) {
    if (marks[i] == ReceiveMark::kNone) continue;
    const Activation& activation = activations[record++];
    const std::uint8_t byte = Frame68(static_cast<std::int64_t>(i / 68)).at(i % 68);
    EXPECT_EQ(activation.time_ns, static_cast<std::int64_t>(i / 68) * kPeriod -
                                      link::BytesTime(921'600, static_cast<std::int64_t>(67 - i % 68)));
    ASSERT_THAT(activation.before, SizeIs(1));
    EXPECT_EQ(activation.before[0].bytes, Bytes{byte});
    if (mark() == ReceiveMark::kOverrun) {
      EXPECT_THAT(activation.after, IsEmpty());
      EXPECT_TRUE(activation.what.ends_with(" lost")) << activation.what;
    } else {
      ASSERT_THAT(activation.after, SizeIs(1));
      EXPECT_EQ(activation.after[0].bytes, Bytes{byte});
    }
  }
}

TEST_P(ReceiverConformanceTest, TriggerCountsBytes) {
  FaultSpec spec = With(1.0);
  spec.every_nth_count = 100;
  const Marks marks = Receive({spec}, 100);
  for (std::size_t i = 0; i < marks.size(); ++i)
    ASSERT_EQ(marks[i] != ReceiveMark::kNone, i % 100 == 99) << i;
  spec.message = "reply";
  EXPECT_THAT(Validate(spec), ElementsAre(Field(&Problem::key, "message")));
}

TEST_P(ReceiverConformanceTest, OnAnIdealLineBytesArriveTogether) {
  FaultSchedule schedule = AtTheLine({At(With(1.0), kPeriod)}, 1, {.baud = 0, .reference_baud = 0});
  schedule.SetOrigin(kOriginAtPowerOn);
  Marks marks;
  schedule.MarkReceived(Direction::kToClient, BootTime(kPeriod - 1), Frame68(0), marks);
  EXPECT_THAT(marks, Each(ReceiveMark::kNone));
  schedule.MarkReceived(Direction::kToClient, BootTime(kPeriod), Frame68(1), marks);
  EXPECT_THAT(marks, Each(mark()));
}

std::vector<FaultType> TypesOfTheReceiver() {
  std::vector<FaultType> types;
  for (const FaultType& type : FaultTypes())
    if (type.IsOneOf<ReceiverKind>()) types.push_back(type);
  return types;
}

INSTANTIATE_TEST_SUITE_P(All, ReceiverConformanceTest, ::testing::ValuesIn(TypesOfTheReceiver()), TestName);

TEST(ReceiverTest, ThreeTypesThreeMarks) {
  std::vector<ReceiveMark> marks;
  for (const FaultType& type : TypesOfTheReceiver()) marks.push_back(type.As<ReceiverKind>()->mark);
  EXPECT_THAT(marks, ::testing::UnorderedElementsAre(ReceiveMark::kOverrun, ReceiveMark::kFraming,
                                                     ReceiveMark::kNoise));
}

// As EveryBuild.DrawsTheSameBits: written down, for builds that optimise otherwise.
TEST(ReceiverTest, EveryBuildMarksTheSameBytes) {
  const Marks marks = Receive({Spec("uart.overrun", {{"probability", 0.01}})}, 20, 20);
  std::vector<std::size_t> marked;
  for (std::size_t i = 0; i < marks.size(); ++i)
    if (marks[i] != ReceiveMark::kNone) marked.push_back(i);
  EXPECT_THAT(marked, ElementsAre(145, 146, 269, 315, 329, 340, 569, 720, 952, 1330));
}

}  // namespace
}  // namespace tiltproof::faults
