// Faults on nodes and on the device in a scenario's file: which keys they have, and who can fly them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <string>
#include <vector>

#include "faults/registry.h"
#include "harness/scenario/fault_support.h"
#include "harness/scenario/reader.h"

namespace tiltproof::harness {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::StartsWith;

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
  const ClientAbilities lockstep{ClientKind::kLibrary, false}, realtime{ClientKind::kLibrary, true};
  EXPECT_THAT(UnsupportedFaults(Read("- {id: a, type: harness.null}\n"), lockstep), IsEmpty());
  const Scenario scenario = Read(
      "- {id: a, type: harness.null}\n"
      "- {id: gone, type: node.kill, start_s: 3, parameters: {node: client}}\n"
      "- {id: b, type: dds.loss, parameters: {node: all, probability: 0.1}}\n");
  EXPECT_THAT(UnsupportedFaults(scenario, realtime), IsEmpty());
  const std::string file = (folder_ / "s.yaml").string();
  EXPECT_THAT(
      UnsupportedFaults(scenario, lockstep),
      ElementsAre(
          file + ":6:20: fault 'gone' (node.kill) acts on a node, which in lockstep is no process: it needs "
                 "--mode realtime",
          StartsWith(file + ":7:17: fault 'b' (dds.loss) acts on a node")));
  // Put together in code, it has no place.
  Scenario made;
  made.faults.resize(1);
  made.faults[0].id = "gone";
  made.faults[0].type = "clock.skew";
  EXPECT_THAT(UnsupportedFaults(made, lockstep), ElementsAre(StartsWith("fault 'gone' (clock.skew) ")));
}

TEST_F(NodeFaultTest, ABoardsClockDriftsByOneFaultAtATime) {
  const auto drifts = [](const std::string& window) {
    return "- {id: a, type: device.clock_drift, start_s: 1, end_s: 3, parameters: {ppm: 100}}\n"
           "- {id: b, type: device.clock_drift, " +
           window + ", parameters: {ppm: 100}}\n";
  };
  EXPECT_EQ(Error(drifts("start_s: 2, end_s: 4")),
            "s.yaml:6:17: type: drifts at the same time as fault 'a': let their windows not overlap");
  EXPECT_EQ(Read(drifts("start_s: 3, end_s: 4")).faults.size(), 2U);
}

TEST_F(NodeFaultTest, DeviceFaultsAreReadAndWrittenBack) {
  const Scenario scenario = Read(
      "- {id: a, type: device.reset, start_s: 3, parameters: {boot_ms: 20}}\n"
      "- {id: b, type: device.hang, start_s: 4}\n"
      "- {id: c, type: device.bit_flip, start_s: 0, end_s: 12, parameters: {region: g_controller}}\n"
      "- {id: d, type: device.clock_drift, parameters: {ppm: -50}}\n"
      "- {id: e, type: uart.overrun, parameters: {probability: 0.001}}\n");
  EXPECT_EQ(scenario.faults.at(1).end_ns, kNever);
  EXPECT_EQ(std::get<std::string>(scenario.faults[2].parameters.at("region")), "g_controller");
  EXPECT_EQ(std::get<double>(scenario.faults[2].parameters.at("bit_count")), 1.0);
  EXPECT_EQ(scenario.faults[3].start_ns, kPowerOn);
  EXPECT_EQ(scenario.faults[4].target, faults::Target::kToClient);
  EXPECT_THAT(WriteResolved(scenario), HasSubstr(R"(  - id: "c"
    type: device.bit_flip
    parameters:
      region: "g_controller"
      bit_count: 1
    start_s: 0
    end_s: 12
)"));
}

TEST_F(NodeFaultTest, KeysThatDeviceAndReceiverFaultsDoNotHave) {
  EXPECT_EQ(Error("- {id: a, type: device.hang}\n"), "s.yaml:5:3: missing key 'start_s'");
  EXPECT_EQ(Error("- {id: a, type: device.stall, start_s: 1}\n"), "s.yaml:5:3: missing key 'end_s'");
  EXPECT_THAT(Error("- {id: a, type: device.hang, start_s: 1, end_s: 2}\n"),
              HasSubstr("5:42: end_s: a fault of this type has a begin only"));
  EXPECT_THAT(Error("- {id: a, type: device.hang, start_s: -1}\n"), HasSubstr("5:39: start_s: -1 is out of"));
  EXPECT_THAT(Error("- {id: a, type: device.hang, start_s: 1, probability: 0.5}\n"),
              HasSubstr("5:42: probability: a fault on the device has no target and no trigger"));
  const auto flip = [](const std::string& region) {
    return "- {id: a, type: device.bit_flip, start_s: 1, parameters: {region: " + region + "}}\n";
  };
  EXPECT_THAT(Error(flip("\"\"")), HasSubstr("5:67: region: the text is empty"));
  EXPECT_THAT(Error(flip("\" ram\"")), HasSubstr("5:67: region: ' ram' must be printable ASCII, without"));
  EXPECT_THAT(Error(flip("r\u00e4m")), HasSubstr("must be printable ASCII"));
  EXPECT_THAT(Error(flip(std::string(201, 'x'))), HasSubstr("region: longer than 200 bytes"));
  EXPECT_THAT(Error("- {id: a, type: uart.noise_error, target: both, parameters: {probability: 1}}\n"),
              HasSubstr("target: unknown value 'both'"));
  EXPECT_THAT(Error("- {id: a, type: uart.noise_error, message: reply, parameters: {probability: 1}}\n"),
              HasSubstr("unknown key 'message'"));
}

// What each client can suffer, as docs/scenario.md says.
TEST(FaultSupportTest, EachClientInEachMode) {
  struct Client {
    ClientAbilities abilities;
    std::set<std::string> types;  // of the layers device and uart
  };
  const std::vector<Client> clients = {
      {{ClientKind::kEmulator, false},
       {"device.reset", "device.watchdog_reset", "device.hang", "device.stall", "device.bit_flip",
        "device.clock_drift", "uart.overrun", "uart.framing_error", "uart.noise_error"}},
      {{ClientKind::kEmulator, true}, {"device.reset", "device.stall", "device.bit_flip"}},
      {{ClientKind::kLibrary, false}, {"device.reset"}},
      {{ClientKind::kLibrary, true}, {}},
      {{ClientKind::kProcess, true}, {}},
      {{ClientKind::kSerial, true}, {}},
  };
  for (const Client& client : clients) {
    std::set<std::string> found;
    for (const faults::FaultType& type : faults::FaultTypes()) {
      const bool possible = !Unsupported(type, client.abilities);
      if (type.layer() == "device" || type.layer() == "uart") {
        if (possible) found.emplace(type.name);
      } else {
        EXPECT_EQ(possible, !type.on_node || client.abilities.realtime) << type.name;
      }
    }
    EXPECT_EQ(found, client.types) << static_cast<int>(client.abilities.client) << client.abilities.realtime;
  }
  const auto why = [](const char* type, ClientAbilities abilities) {
    return Unsupported(*faults::FindFaultType(type), abilities).value_or("nothing");
  };
  EXPECT_EQ(why("device.stall", {ClientKind::kLibrary, false}),
            "needs an emulated board: fly it with --client qemu");
  EXPECT_THAT(why("device.hang", {ClientKind::kEmulator, true}), HasSubstr("--mode lockstep"));
  EXPECT_THAT(why("uart.parity_error", {ClientKind::kEmulator, false}), HasSubstr("8N1"));
}

}  // namespace
}  // namespace tiltproof::harness
