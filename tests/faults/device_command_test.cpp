// Commands of faults on the firmware's processor, their times, and the bits of its memory that flip.

#include "faults/device_command.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "faults/node_command.h"
#include "faults/random.h"
#include "tests/faults/faulty_line.h"
#include "tests/faults/goodness_of_fit.h"

namespace tiltproof::faults {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::Field;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

FaultSpec Flip(TimeNs start_ns, TimeNs end_ns = kNever, const std::string& id = "flip") {
  return At(Spec("device.bit_flip", {{"region", "ram"}}, id), start_ns, end_ns);
}

DeviceCommand Only(const FaultSpec& spec, std::uint64_t seed = 1) {
  return DeviceCommands({spec}, seed).at(0);
}

TEST(DeviceCommandTest, NoFaultOnTheDeviceNoCommand) {
  EXPECT_THAT(DeviceCommands({}, 1), IsEmpty());
  EXPECT_THAT(DeviceCommands(
                  {Spec("sensor.freeze", {{"signal", "x_m"}}), At(Spec("node.kill", {{"node", "plant"}}), 0),
                   Spec("uart.overrun", {{"probability", 1.0}})},
                  1),
              IsEmpty());
}

TEST(DeviceCommandTest, AreInOrderOfTimeThenOfTheFile) {
  const std::vector<FaultSpec> specs = {At(Spec("device.hang", {}, "a"), 9 * kNsPerS),
                                        At(Spec("device.stall", {}, "b"), 4 * kNsPerS, 5 * kNsPerS),
                                        At(Spec("device.reset", {{"boot_ms", 20.0}}, "c"), 4 * kNsPerS),
                                        Spec("clock.drift", {{"ppm", 50.0}}, "d"),
                                        Flip(kNsPerS, 2 * kNsPerS)};
  std::vector<std::size_t> order;
  for (const DeviceCommand& command : DeviceCommands(specs, 1)) order.push_back(command.fault);
  EXPECT_THAT(order, ElementsAre(3, 4, 1, 2, 0));
}

TEST(DeviceCommandTest, EachTypeSaysWhenItIsTakenBack) {
  for (const char* type : {"device.reset", "device.watchdog_reset"}) {
    const FaultSpec reset = At(Spec(type, {{"boot_ms", 1.5}}), 3 * kNsPerS);
    EXPECT_EQ(Only(reset).at_ns, 3 * kNsPerS);
    EXPECT_EQ(Only(reset).until_ns, 3 * kNsPerS + 1'500'000);
    const FaultSchedule schedule = AtTheLine({reset}, 1);
    EXPECT_FALSE(schedule.IsActive(0, 3 * kNsPerS - 1));
    EXPECT_TRUE(schedule.IsActive(0, 3 * kNsPerS + 1'499'999));
    EXPECT_FALSE(schedule.IsActive(0, 3 * kNsPerS + 1'500'000));
  }
  const DeviceCommand hang = Only(At(Spec("device.hang"), 7));
  EXPECT_EQ(hang.at_ns, 7);
  EXPECT_EQ(hang.until_ns, kNever);
  const DeviceCommand stall = Only(At(Spec("device.stall"), 3, 8));
  EXPECT_EQ(stall.at_ns, 3);
  EXPECT_EQ(stall.until_ns, 8);
  const DeviceCommand drift = Only(Spec("clock.drift", {{"ppm", -20.0}}));
  EXPECT_EQ(drift.at_ns, 0);  // from the start of the flight, not from power-on
  EXPECT_EQ(drift.until_ns, kNever);
  EXPECT_EQ(std::get<DriftClock>(drift.action).ppm, -20.0);
  const DeviceCommand drift_in_window = Only(At(Spec("clock.drift", {{"ppm", 5.0}}), 3, 8));
  EXPECT_EQ(drift_in_window.at_ns, 3);
  EXPECT_EQ(drift_in_window.until_ns, 8);
}

TEST(DeviceCommandTest, ABitFlipWithoutAnEndHappensAtItsStart) {
  const DeviceCommand flip = Only(Flip(3));
  EXPECT_EQ(flip.at_ns, 3);
  EXPECT_EQ(flip.until_ns, kNever);
  EXPECT_EQ(std::get<FlipBits>(flip.action).region, "ram");
  EXPECT_EQ(std::get<FlipBits>(flip.action).bit_count, 1);
}

TEST(DeviceCommandTest, ABitFlipsInstantIsDrawnFromItsWindow) {
  // A window of one nanosecond leaves no choice.
  EXPECT_EQ(Only(Flip(41, 42), 9).at_ns, 41);
  const auto instant = [](std::uint64_t seed, const std::string& id = "flip") {
    return Only(Flip(2 * kNsPerS, 12 * kNsPerS, id), seed).at_ns;
  };
  EXPECT_EQ(instant(5), instant(5));
  EXPECT_NE(instant(5), instant(6));
  EXPECT_NE(instant(5), instant(5, "another"));
  // Uniform over the window.
  constexpr int kSeeds = 100'000;
  std::vector<double> parts(100);
  for (int seed = 0; seed < kSeeds; ++seed) {
    const TimeNs t = instant(static_cast<std::uint64_t>(seed));
    ASSERT_GE(t, 2 * kNsPerS);
    ASSERT_LT(t, 12 * kNsPerS);
    ++parts.at(static_cast<std::size_t>((t - 2 * kNsPerS) / (kNsPerS / 10)));
  }
  EXPECT_TRUE(AreUniform(parts));
}

TEST(DeviceCommandTest, NeitherOtherFaultsNorTheWindowShiftWhichBitsFlip) {
  const DeviceCommand alone = Only(Flip(0, 12 * kNsPerS), 3);
  const auto commands =
      DeviceCommands({Flip(0, 12 * kNsPerS, "other"), At(Spec("device.hang"), 1), Flip(0, 12 * kNsPerS)}, 3);
  const auto same =
      std::find_if(commands.begin(), commands.end(), [](const auto& command) { return command.fault == 2; });
  EXPECT_EQ(same->at_ns, alone.at_ns);
  const auto stream = [](const DeviceCommand& command) { return std::get<FlipBits>(command.action).stream; };
  EXPECT_EQ(stream(*same), stream(alone));
  EXPECT_EQ(stream(Only(Flip(5), 3)), stream(alone));
  EXPECT_NE(stream(Only(Flip(5), 4)), stream(alone));
}

std::vector<BitFlip> Draw(std::uint64_t stream, std::uint32_t size_bytes, std::int64_t bit_count) {
  return DrawBitFlips({.region = "ram", .bit_count = bit_count, .stream = stream}, size_bytes);
}

TEST(DrawBitFlipsTest, BitsAreDifferentAndInTheRegion) {
  for (std::uint64_t stream = 0; stream < 200; ++stream) {
    const auto flips = Draw(stream, 8, 64);  // every bit there is
    std::set<std::pair<std::uint32_t, int>> bits;
    for (const BitFlip& flip : flips) {
      EXPECT_LT(flip.byte_offset, 8U);
      EXPECT_TRUE(flip.bit >= 0 && flip.bit < 8);
      bits.emplace(flip.byte_offset, flip.bit);
    }
    ASSERT_THAT(bits, SizeIs(64)) << stream;
  }
}

TEST(DrawBitFlipsTest, FewerBitsAreTheFirstOfMore) {
  const auto many = Draw(7, 1000, 64);
  const auto few = Draw(7, 1000, 5);
  EXPECT_TRUE(std::equal(few.begin(), few.end(), many.begin()));
  EXPECT_THAT(few, SizeIs(5));
}

TEST(DrawBitFlipsTest, ThereMustBeThatManyBits) {
  EXPECT_THAT(Draw(1, 0, 0), IsEmpty());
  EXPECT_THAT(Draw(1, 4, 32), SizeIs(32));
  EXPECT_THROW(Draw(1, 4, 33), std::invalid_argument);
  EXPECT_THROW(Draw(1, 0, 1), std::invalid_argument);
  // The whole address space counts more bits than 32 bits do.
  EXPECT_THAT(Draw(1, 0xFFFFFFFFU, 1), SizeIs(1));
}

// Each bit of a region of 6 bytes (48 does not divide 2^64) and each bit number alike, also for later draws.
TEST(DrawBitFlipsTest, EveryBitAlike) {
  constexpr int kRuns = 48'000;
  std::array<double, 48> counts{};
  for (int run = 0; run < kRuns; ++run)
    for (const BitFlip& flip : Draw(KeyOf(99, static_cast<std::uint64_t>(run)), 6, 3))
      ++counts.at(8 * flip.byte_offset + static_cast<std::size_t>(flip.bit));
  // Each is binomial with p = 3/48.
  const double expected = kRuns * 3.0 / 48.0;
  for (const double count : counts) EXPECT_NEAR(count, expected, 6 * std::sqrt(expected));
}

// The generator is SplitMix64; its outputs for state 0 are published: 0xe220a8397b1dcdaf, 0x6e789e6aa1b965f4.
TEST(DrawBitFlipsTest, SameBitsOnEveryMachine) {
  EXPECT_THAT(Draw(0, 256, 2), ElementsAre(BitFlip{0x5AF / 8, 0x5AF % 8}, BitFlip{0x5F4 / 8, 0x5F4 % 8}));
}

TEST(DeviceCommandTest, AnInvalidFaultIsRefusedByName) {
  try {
    DeviceCommands({Spec("device.hang", {}, "stuck")}, 1);
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), HasSubstr("fault 'stuck', start_s: device.hang needs start_s"));
  }
}

// Rules that every such type must keep.
class DeviceConformanceTest : public ::testing::TestWithParam<FaultType> {
 protected:
  const FaultType& type() const { return GetParam(); }
};

TEST_P(DeviceConformanceTest, EditsNothing) {
  FaultSchedule schedule = AtThePlant({ExampleSpec(type())}, 1);
  schedule.SetOrigin(kOriginAtPowerOn);
  for (const auto direction :
       {link::Direction::kToClient, link::Direction::kToPlant, link::Direction::kReference})
    EXPECT_EQ(schedule.Filter(direction), nullptr);
  std::vector<ReceiveMark> marks;
  for (TimeNs t = 0; t < 12 * kNsPerS; t += 12 * kNsPerMs) {
    Sensors sensors{.x_m = 1.25F};
    ActuatorsTruth command{.f_r_n = 8.0};
    EditSensors(schedule, t, sensors);
    EditActuators(schedule, t, command);
    ASSERT_EQ(sensors, Sensors{.x_m = 1.25F});
    ASSERT_EQ(command, ActuatorsTruth{.f_r_n = 8.0});
    schedule.MarkReceived(link::Direction::kToClient, kOriginAtPowerOn.ToBootTime(t), Bytes{1, 2, 3}, marks);
    ASSERT_THAT(marks, ::testing::Each(ReceiveMark::kNone));
  }
  EXPECT_THAT(schedule.ActivationCounts(), ElementsAre(0));
}

TEST_P(DeviceConformanceTest, IsOneCommandWithinItsWindow) {
  const FaultSpec spec = ExampleSpec(type());
  const FaultSpec other = Spec("sensor.bias", {{"signal", "x_m"}, {"offset", 0.0}}, "other");
  EXPECT_THAT(NodeCommands({other, spec}), IsEmpty());
  const std::vector<DeviceCommand> commands = DeviceCommands({other, spec}, 1);
  ASSERT_THAT(commands, SizeIs(1));
  EXPECT_EQ(commands[0].fault, 1U);
  EXPECT_EQ(commands[0].at_ns, std::max<TimeNs>(spec.start_ns, 0));
  const FaultSchedule schedule = AtTheLine({other, spec}, 1);
  for (TimeNs t = 0; t < 12 * kNsPerS; t += 100 * kNsPerMs)
    ASSERT_EQ(schedule.IsActive(1, t), commands[0].at_ns <= t && t < commands[0].until_ns) << t;
}

TEST_P(DeviceConformanceTest, HasNoTriggerAndNothingBeforeTheStart) {
  const auto refused = [&](const std::string& key, auto&& change) {
    FaultSpec spec = ExampleSpec(type());
    change(spec);
    EXPECT_THAT(Validate(spec), Contains(Field(&Problem::key, key))) << key;
    EXPECT_THROW(AtTheLine({spec}, 1), std::invalid_argument);
    EXPECT_THROW(DeviceCommands({spec}, 1), std::invalid_argument);
  };
  refused("every_nth_count", [](FaultSpec& spec) { spec.every_nth_count = 2; });
  refused("probability", [](FaultSpec& spec) { spec.probability = 0.5; });
  refused("message", [](FaultSpec& spec) { spec.message = "reply"; });
  refused("start_s", [](FaultSpec& spec) { spec.start_ns = -1; });
}

std::vector<FaultType> TypesOnTheDevice() {
  std::vector<FaultType> types;
  for (const FaultType& type : FaultTypes())
    if (type.IsOneOf<DeviceKind>()) types.push_back(type);
  return types;
}

INSTANTIATE_TEST_SUITE_P(All, DeviceConformanceTest, ::testing::ValuesIn(TypesOnTheDevice()), TestName);

}  // namespace
}  // namespace tiltproof::faults
