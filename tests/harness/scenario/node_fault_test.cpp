// Faults on nodes in a scenario's file: which keys they have, and that lockstep cannot fly them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "harness/scenario/reader.h"

namespace tiltproof::harness {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class NodeFaultTest : public testing::Test {
 protected:
  NodeFaultTest()
      : folder_(fs::path(testing::TempDir()) /
                (std::string("tiltproof_node_fault_") +
                 testing::UnitTest::GetInstance()->current_test_info()->name())) {
    fs::create_directories(folder_ / "models");
    std::ofstream(folder_ / "models/tiltrotor.sdf") << "<sdf/>";
    options_.models_folder = folder_ / "models";
  }
  ~NodeFaultTest() override { fs::remove_all(folder_); }

  // A scenario whose fifth and later lines are items of `faults`.
  Scenario Read(const std::string& faults) {
    const fs::path file = folder_ / "s.yaml";
    std::ofstream(file) << "name: x\nduration_s: 24\nreference: {type: hover, at_m: [0, 0, 2]}\nfaults:\n"
                        << faults;
    return ReadScenario(file, options_);
  }
  // What is wrong with it, without the folder.
  std::string Error(const std::string& faults) {
    try {
      Read(faults);
    } catch (const ScenarioError& error) {
      return error.what() + folder_.string().size() + 1;
    }
    return "no error";
  }

  fs::path folder_;
  ReadOptions options_;
};

TEST_F(NodeFaultTest, AreReadAndWrittenBack) {
  const Scenario scenario = Read(
      "- {id: a, type: node.kill, start_s: 3, parameters: {node: base_station}}\n"
      "- {id: b, type: node.restart, start_s: 0, parameters: {node: client, down_ms: 500}}\n"
      "- {id: c, type: clock.skew, parameters: {node: client, ppm: -200}}\n");
  EXPECT_EQ(scenario.faults.at(0).start_ns, 3 * kNsPerS);
  EXPECT_EQ(scenario.faults[0].end_ns, kNever);
  EXPECT_EQ(std::get<double>(scenario.faults[1].parameters.at("down_ms")), 500.0);
  EXPECT_EQ(scenario.faults[2].start_ns, kPowerOn);
  EXPECT_EQ(std::get<double>(scenario.faults[2].parameters.at("offset_ms")), 0.0);
  EXPECT_THAT(WriteResolved(scenario), HasSubstr(R"(  - id: "a"
    type: node.kill
    parameters:
      node: base_station
    start_s: 3
  - id: "b"
)"));
}

TEST_F(NodeFaultTest, KeysThatTheyDoNotHaveAreRefusedWithTheReason) {
  const auto kill = [](const std::string& more) {
    return "- {id: a, type: node.kill, parameters: {node: plant}" + more + "}\n";
  };
  EXPECT_EQ(Error(kill("")), "s.yaml:5:3: missing key 'start_s'");
  EXPECT_EQ(Error(kill(", start_s: -1")),
            "s.yaml:5:64: start_s: -1 is out of range; must be from 0 to 86400");
  EXPECT_EQ(Error(kill(", start_s: 1, end_s: 2")),
            "s.yaml:5:67: end_s: a fault of this type has a begin only");
  for (const std::string key : {"target: both", "message: reply", "every_nth_count: 1", "probability: 1"})
    EXPECT_THAT(Error(kill(", start_s: 1, " + key)),
                HasSubstr("5:67: " + key.substr(0, key.find(':')) +
                          ": a fault on a node has no target and no trigger"));
  EXPECT_THAT(Error("- {id: a, type: dds.loss, start_s: 1, parameters: {node: all, probability: 0.1}}\n"),
              HasSubstr("start_s: a fault of this type lasts the whole flight"));
  EXPECT_EQ(Error("- {id: a, type: node.pause, start_s: 1, parameters: {node: plant}}\n"),
            "s.yaml:5:3: missing key 'end_s'");
  EXPECT_THAT(Error(kill(", start_s: 24")), HasSubstr("the flight is over by then"));
}

TEST_F(NodeFaultTest, NeedRealTimeAndSayWhere) {
  EXPECT_EQ(NeedsRealtime(Read("- {id: a, type: harness.null}\n")), std::nullopt);
  const auto why =
      NeedsRealtime(Read("- {id: a, type: harness.null}\n"
                         "- {id: gone, type: node.kill, start_s: 3, parameters: {node: client}}\n"
                         "- {id: b, type: dds.loss, parameters: {node: all, probability: 0.1}}\n"));
  EXPECT_EQ(why.value_or("nothing"),
            (folder_ / "s.yaml").string() +
                ":6:20: fault 'gone' (node.kill) acts on a node, which in lockstep is no process: it needs "
                "--mode realtime");
  // Put together in code, it has no place.
  Scenario made;
  made.faults.resize(1);
  made.faults[0].id = "gone";
  made.faults[0].type = "clock.skew";
  EXPECT_THAT(NeedsRealtime(made).value_or("nothing"), testing::StartsWith("fault 'gone' (clock.skew) "));
}

}  // namespace
}  // namespace tiltproof::harness
