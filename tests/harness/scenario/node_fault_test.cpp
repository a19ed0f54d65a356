// Faults on nodes and on the device in a scenario's file: which keys they have, and who can fly them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>
#include <string>
#include <vector>

#include "faults/registry.h"
#include "harness/scenario/fault_support.h"
#include "harness/scenario/reader.h"
#include "tests/harness/scenario/fault_file.h"

namespace tiltproof::harness {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::StartsWith;

using NodeFaultTest = FaultFile;

TEST_F(NodeFaultTest, AreReadAndWrittenBack) {
  const Scenario scenario = Read(
      "- {id: a, type: node.kill, start_s: 3, parameters: {node: base_station}}\n"
      "- {id: b, type: node.restart, start_s: 0, parameters: {node: client, down_ms: 500}}\n"
      "- {id: c, type: clock.drift, parameters: {ppm: -200}}\n");
  EXPECT_EQ(scenario.faults.at(0).start_ns, 3 * kNsPerS);
  EXPECT_EQ(scenario.faults[0].end_ns, kNever);
  EXPECT_EQ(std::get<double>(scenario.faults[1].parameters.at("down_ms")), 500.0);
  EXPECT_EQ(scenario.faults[2].start_ns, kPowerOn);
  EXPECT_EQ(std::get<std::string>(scenario.faults[2].parameters.at("node")), "client");
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
  const std::vector lockstep = {AbilitiesOf(HostLibrary{}, false)},
                    realtime = {AbilitiesOf(HostLibrary{}, true)};
  EXPECT_THAT(UnsupportedFaults(Read("- {id: a, type: harness.null}\n"), lockstep), IsEmpty());
  const Scenario scenario = Read(
      "- {id: a, type: harness.null}\n"
      "- {id: gone, type: node.kill, start_s: 3, parameters: {node: client}}\n"
      "- {id: b, type: dds.loss, parameters: {node: all, probability: 0.1}}\n");
  EXPECT_THAT(UnsupportedFaults(scenario, realtime), IsEmpty());
  const std::string file = (folder_ / "s.yaml").string();
  std::vector<std::string> texts;
  for (const Problem& problem : UnsupportedFaults(scenario, lockstep)) texts.push_back(problem.text);
  EXPECT_THAT(
      texts,
      ElementsAre(
          file +
              ":6:20: fault 'gone' (node.kill) acts on a node, and lockstep has no node processes: it needs "
              "--mode realtime",
          StartsWith(file + ":7:17: fault 'b' (dds.loss) acts on a node")));
  // Put together in code, it has no place.
  Scenario made;
  made.faults.resize(1);
  made.faults[0].id = "gone";
  made.faults[0].type = "clock.jump";
  made.faults[0].parameters["node"] = "plant";
  const std::vector<Problem> jump = UnsupportedFaults(made, lockstep);
  ASSERT_EQ(jump.size(), 1U);
  EXPECT_EQ(jump[0].text, "fault 'gone' (clock.jump) " + jump[0].why);
}

TEST_F(NodeFaultTest, AClockDriftsByOneFaultAtATime) {
  const auto drifts = [](const std::string& window, const std::string& node = "client") {
    return "- {id: a, type: clock.drift, start_s: 1, end_s: 3, parameters: {ppm: 100}}\n"
           "- {id: b, type: clock.drift, " +
           window + ", parameters: {node: " + node + ", ppm: 100}}\n";
  };
  EXPECT_EQ(Error(drifts("start_s: 2, end_s: 4")),
            "s.yaml:6:17: type: drifts at the same time as fault 'a': let their windows not overlap");
  EXPECT_EQ(Read(drifts("start_s: 3, end_s: 4")).faults.size(), 2U);
  EXPECT_EQ(Read(drifts("start_s: 2, end_s: 4", "link")).faults.size(), 2U);
}

TEST_F(NodeFaultTest, FormerTypesSayWhatStandsForThem) {
  EXPECT_EQ(Error("- {id: a, type: clock.skew, parameters: {node: client, ppm: 1}}\n"),
            "s.yaml:5:17: type: 'clock.skew' was replaced by clock.drift {node, ppm} and clock.jump {node, "
            "jump_ms}");
  EXPECT_EQ(Error("- {id: a, type: device.clock_drift, parameters: {ppm: 1}}\n"),
            "s.yaml:5:17: type: 'device.clock_drift' was replaced by clock.drift {ppm}");
  EXPECT_EQ(Error("- {id: a, type: uart.parity_error, parameters: {probability: 1}}\n"),
            "s.yaml:5:17: type: 'uart.parity_error' was removed: set link.parity, and flip bits with "
            "wire.bit_error");
}

TEST_F(NodeFaultTest, DeviceFaultsAreReadAndWrittenBack) {
  const Scenario scenario = Read(
      "- {id: a, type: device.reset, start_s: 3, parameters: {boot_ms: 20}}\n"
      "- {id: b, type: device.hang, start_s: 4}\n"
      "- {id: c, type: device.bit_flip, start_s: 0, end_s: 12, parameters: {region: g_controller}}\n"
      "- {id: d, type: clock.drift, parameters: {ppm: -50}}\n"
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

faults::FaultSpec Example(const faults::FaultType& type) {
  faults::FaultSpec fault;
  fault.id = "f";
  fault.type = type.name;
  for (const faults::ParameterInfo& info : type.parameters)
    fault.parameters[std::string(info.name)] = info.example;
  return fault;
}

// Faults that each client can take, as docs/scenario.md lists them.
TEST(FaultSupportTest, EachClientInEachMode) {
  struct Client {
    ClientSpec client;
    bool realtime;
    std::set<std::string> types;  // of the layers device, uart and clock, as in their examples
  };
  const std::vector<Client> clients = {
      {EmulatedImage{},
       false,
       {"device.reset", "device.watchdog_reset", "device.hang", "device.stall", "device.bit_flip",
        "device.task_delay", "clock.drift", "uart.overrun", "uart.framing_error", "uart.noise_error"}},
      {EmulatedImage{}, true, {"device.reset", "device.stall", "device.bit_flip"}},
      {HostLibrary{},
       false,
       {"device.reset", "device.task_delay", "device.slow_cpu", "clock.drift", "clock.jump"}},
      {HostLibrary{}, true, {"clock.drift", "clock.jump"}},
      {LockstepProgram{},
       false,
       {"device.reset", "device.task_delay", "device.slow_cpu", "clock.drift", "clock.jump"}},
      {LockstepProgram{"", true}, false, {"device.reset", "device.task_delay", "clock.drift", "clock.jump"}},
      {Program{}, true, {}},
      {SerialBoard{}, true, {}},
  };
  for (const Client& client : clients) {
    const ClientAbilities abilities = AbilitiesOf(client.client, client.realtime);
    std::set<std::string> found;
    for (const faults::FaultType& type : faults::FaultTypes()) {
      const bool possible = !Unsupported(Example(type), type, abilities);
      if (type.layer() == "device" || type.layer() == "uart" || type.layer() == "clock") {
        if (possible) found.emplace(type.name);
      } else {
        EXPECT_EQ(possible, !type.IsOneOf<faults::NodeKind>() || client.realtime) << type.name;
      }
    }
    EXPECT_EQ(found, client.types) << KindOf(client.client) << client.realtime;
  }
  const auto why = [](const char* type, const ClientAbilities& abilities) {
    const faults::FaultType& found = *faults::FindFaultType(type);
    return Unsupported(Example(found), found, abilities).value_or("nothing");
  };
  EXPECT_EQ(why("device.stall", AbilitiesOf(HostLibrary{}, false)),
            "needs an emulated board: fly it with --client qemu");
  EXPECT_THAT(why("device.hang", AbilitiesOf(EmulatedImage{}, true)), HasSubstr("--mode lockstep"));
}

TEST(FaultSupportTest, WhoseClockDependsOnTheNode) {
  const auto why = [](const char* type, const char* node, const ClientSpec& client, bool realtime) {
    const faults::FaultType& found = *faults::FindFaultType(type);
    faults::FaultSpec fault = Example(found);
    fault.parameters["node"] = node;
    return Unsupported(fault, found, AbilitiesOf(client, realtime)).value_or("nothing");
  };
  for (const char* type : {"clock.drift", "clock.jump"})
    for (const char* node : {"plant", "link", "base_station"}) {
      EXPECT_THAT(why(type, node, EmulatedImage{}, false), HasSubstr("it needs --mode realtime"));
      for (const ClientSpec& client :
           {ClientSpec(EmulatedImage{}), ClientSpec(Program{}), ClientSpec(HostLibrary{})})
        EXPECT_EQ(why(type, node, client, true), "nothing");
    }
  EXPECT_EQ(why("clock.drift", "client", EmulatedImage{}, false), "nothing");
  EXPECT_THAT(why("clock.drift", "client", EmulatedImage{}, true), HasSubstr("its own"));
  EXPECT_THAT(why("clock.drift", "client", SerialBoard{}, true), HasSubstr("its own"));
  for (const ClientSpec& client : {ClientSpec(HostLibrary{}), ClientSpec(LockstepProgram{})})
    EXPECT_EQ(why("clock.jump", "client", client, false), "nothing");
  EXPECT_EQ(
      why("clock.jump", "client", EmulatedImage{}, false),
      "lets the client's clock jump, and the processor of an emulated board would execute everything in "
      "between: fly it with host, library:FILE or program:CMD");
}

}  // namespace
}  // namespace tiltproof::harness
