// Commands that faults give the harness for its nodes, and their times.

#include "faults/node_command.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>
#include <string>
#include <variant>
#include <vector>

#include "tests/faults/faulty_line.h"

namespace tiltproof::faults {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::Field;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

TEST(NodeCommandTest, NoFaultOnANodeNoCommand) {
  EXPECT_THAT(NodeCommands({}), IsEmpty());
  EXPECT_THAT(NodeCommands({Spec("sensor.freeze", {{"signal", "x_m"}}), Spec("link.silence")}), IsEmpty());
}

TEST(NodeCommandTest, AreInOrderOfTimeThenOfTheFile) {
  const std::vector<FaultSpec> specs = {
      At(Spec("node.kill", {{"node", "plant"}}), 9 * kNsPerS),
      Spec("sensor.freeze", {{"signal", "x_m"}}),
      At(Spec("node.pause", {{"node", "client"}}), 4 * kNsPerS, 5 * kNsPerS),
      At(Spec("dds.partition", {{"node", "all"}}), 4 * kNsPerS, 6 * kNsPerS),
      Spec("dds.loss", {{"node", "link"}, {"probability", 0.1}}),
      At(Spec("clock.drift", {{"ppm", -500.0}}), 0)};
  std::vector<std::size_t> order;
  for (const NodeCommand& command : NodeCommands(specs)) order.push_back(command.fault);
  EXPECT_THAT(order, ElementsAre(4, 5, 2, 3, 0));
}

TEST(NodeCommandTest, ANodeThatIsDownForNoTimeIsStartedAtOnce) {
  const std::vector<NodeCommand> commands =
      NodeCommands({At(Spec("node.restart", {{"node", "client"}, {"down_ms", 0.0}}), 2 * kNsPerS)});
  ASSERT_THAT(commands, SizeIs(1));
  EXPECT_EQ(commands[0].at_ns, 2 * kNsPerS);
  EXPECT_EQ(commands[0].until_ns, 2 * kNsPerS);
}

TEST(NodeCommandTest, EachTypeSaysWhenItIsTakenBack) {
  const auto only = [](const FaultSpec& spec) { return NodeCommands({spec}).at(0); };
  const NodeCommand kill = only(At(Spec("node.kill", {{"node", "link"}}), 3));
  EXPECT_EQ(kill.at_ns, 3);
  EXPECT_EQ(kill.until_ns, kNever);
  EXPECT_EQ(kill.node, "link");
  const NodeCommand pause = only(At(Spec("node.pause", {{"node", "client"}}), 3, 8));
  EXPECT_EQ(pause.until_ns, 8);
  const NodeCommand restart =
      only(At(Spec("node.restart", {{"node", "client"}, {"down_ms", 250.5}}), kNsPerS));
  EXPECT_EQ(restart.until_ns, kNsPerS + 250'500'000);
  const NodeCommand loss = only(Spec("dds.loss", {{"node", "all"}, {"probability", 0.25}}));
  EXPECT_EQ(loss.at_ns, kPowerOn);
  EXPECT_EQ(loss.until_ns, kNever);
  EXPECT_EQ(std::get<LosePackets>(loss.action).probability, 0.25);
  const NodeCommand drift = only(Spec("clock.drift", {{"node", "plant"}, {"ppm", 50.0}}));
  EXPECT_EQ(drift.at_ns, 0);
  EXPECT_EQ(drift.until_ns, kNever);
  EXPECT_EQ(drift.node, "plant");
  EXPECT_EQ(std::get<DriftClock>(drift.action).ppm, 50.0);
  const NodeCommand jump = only(At(Spec("clock.jump", {{"jump_ms", -2.5}}), 3, 8));
  EXPECT_EQ(jump.node, "client");  // the default
  EXPECT_EQ(jump.until_ns, 8);
  EXPECT_EQ(std::get<JumpClock>(jump.action).by_ns, -2'500'000);
}

TEST(NodeCommandTest, ARestartIsOverWhenTheNodeIsStartedAgain) {
  const FaultSpec restart =
      At(Spec("node.restart", {{"node", "base_station"}, {"down_ms", 2000.0}}), 3 * kNsPerS);
  EXPECT_EQ(WindowOf(restart).begin_ns, 3 * kNsPerS);
  EXPECT_EQ(WindowOf(restart).end_ns, 5 * kNsPerS);
  const FaultSchedule schedule = AtTheLine({restart}, 1);
  EXPECT_TRUE(schedule.IsActive(0, 5 * kNsPerS - 1));
  EXPECT_FALSE(schedule.IsActive(0, 5 * kNsPerS));
}

TEST(NodeCommandTest, OnlyNodesThatCanBeAimedAt) {
  const auto valid = [](const std::string& type, const std::string& node) {
    FaultSpec spec = ExampleSpec(*FindFaultType(type));
    spec.parameters["node"] = node;
    return Validate(spec).empty();
  };
  for (const char* type : {"node.kill", "node.pause", "dds.partition", "dds.loss"})
    for (const char* node : {"plant", "link", "client", "base_station"})
      EXPECT_TRUE(valid(type, node)) << type << ' ' << node;
  for (const char* type : {"dds.partition", "dds.loss"}) EXPECT_TRUE(valid(type, "all"));
  for (const char* type : {"node.kill", "node.pause", "node.restart", "clock.drift", "clock.jump"})
    EXPECT_FALSE(valid(type, "all"));
  for (const char* node : {"plant", "link"}) EXPECT_FALSE(valid("node.restart", node));
  for (const char* type : {"clock.drift", "clock.jump"})
    for (const char* node : {"plant", "link", "client", "base_station"})
      EXPECT_TRUE(valid(type, node)) << type << ' ' << node;
}

TEST(NodeCommandTest, AnInvalidFaultIsRefusedByName) {
  FaultSpec kill = Spec("node.kill", {{"node", "plant"}}, "end-of-all");
  try {
    NodeCommands({kill});
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), HasSubstr("fault 'end-of-all', start_s: node.kill needs start_s"));
  }
}

// Rules that every such type must keep.
class NodeConformanceTest : public ::testing::TestWithParam<FaultType> {
 protected:
  const FaultType& type() const { return GetParam(); }
};

TEST_P(NodeConformanceTest, EditsNothing) {
  FaultSchedule schedule = AtThePlant({ExampleSpec(type())}, 1);
  schedule.SetOrigin(kOriginAtPowerOn);
  for (const auto direction :
       {link::Direction::kToClient, link::Direction::kToPlant, link::Direction::kReference})
    EXPECT_EQ(schedule.Filter(direction), nullptr);
  for (TimeNs t = 0; t < 12 * kNsPerS; t += 12 * kNsPerMs) {
    Sensors sensors{.x_m = 1.25F};
    ActuatorsTruth command{.f_r_n = 8.0};
    EditSensors(schedule, t, sensors);
    EditActuators(schedule, t, command);
    ASSERT_EQ(sensors, Sensors{.x_m = 1.25F});
    ASSERT_EQ(command, ActuatorsTruth{.f_r_n = 8.0});
  }
  EXPECT_THAT(schedule.ActivationCounts(), ElementsAre(0));
}

TEST_P(NodeConformanceTest, IsOneCommandInForceWhileItIsActive) {
  const FaultSpec spec = ExampleSpec(type());
  const FaultSpec other = Spec("sensor.bias", {{"signal", "x_m"}, {"offset", 0.0}}, "other");
  const std::vector<NodeCommand> commands = NodeCommands({other, spec});
  ASSERT_THAT(commands, SizeIs(1));
  EXPECT_EQ(commands[0].fault, 1U);
  EXPECT_EQ(commands[0].at_ns,
            type().IsOneOf<ClockKind>() ? std::max<TimeNs>(spec.start_ns, 0) : spec.start_ns);
  EXPECT_EQ(commands[0].node, std::get<std::string>(spec.parameters.at("node")));
  const FaultSchedule schedule = AtTheLine({other, spec}, 1);
  for (TimeNs t = type().IsOneOf<ClockKind>() ? 0 : -kNsPerS; t < 12 * kNsPerS; t += 100 * kNsPerMs)
    ASSERT_EQ(schedule.IsActive(1, t), commands[0].at_ns <= t && t < commands[0].until_ns) << t;
}

TEST_P(NodeConformanceTest, IsCountedByWhoCarriesItOut) {
  FaultSchedule schedule = AtTheLine({ExampleSpec(type())}, 1);
  schedule.Count(0, 3 * kNsPerS, "done");
  schedule.Count(0, kNsPerS, "done before");
  EXPECT_THAT(schedule.ActivationCounts(), ElementsAre(2));
  const std::vector<Activation> activations = schedule.TakeActivations(Origin(BootTime(7 * kNsPerS)));
  ASSERT_THAT(activations, SizeIs(2));
  EXPECT_EQ(activations[0].time_ns, kNsPerS);  // in simulation time, whatever the origin
  EXPECT_EQ(activations[0].what, "done before");
  EXPECT_EQ(activations[1].fault, 0U);
}

TEST_P(NodeConformanceTest, HasNoTriggerAndNothingBeforeTheStart) {
  const auto refused = [&](const std::string& key, auto&& change) {
    FaultSpec spec = ExampleSpec(type());
    change(spec);
    EXPECT_THAT(Validate(spec), Contains(Field(&Problem::key, key))) << key;
    EXPECT_THROW(AtTheLine({spec}, 1), std::invalid_argument);
    EXPECT_THROW(NodeCommands({spec}), std::invalid_argument);
  };
  refused("every_nth_count", [](FaultSpec& spec) { spec.every_nth_count = 2; });
  refused("probability", [](FaultSpec& spec) { spec.probability = 0.5; });
  refused("message", [](FaultSpec& spec) { spec.message = "reply"; });
  refused("start_s", [](FaultSpec& spec) { spec.start_ns = -1; });
}

std::vector<FaultType> TypesOnNodes() {
  std::vector<FaultType> types;
  for (const FaultType& type : FaultTypes())
    if (type.IsOneOf<NodeKind, ClockKind>()) types.push_back(type);
  return types;
}

INSTANTIATE_TEST_SUITE_P(All, NodeConformanceTest, ::testing::ValuesIn(TypesOnNodes()), TestName);

}  // namespace
}  // namespace tiltproof::faults
