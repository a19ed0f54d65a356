// The JSON Schema and the reader agree: judged by an independent validator, python3-jsonschema, on what the
// YAML says.
#include "harness/scenario/schema.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "faults/registry.h"
#include "harness/scenario/reader.h"
#include "harness/scenario/selection.h"
#include "harness/scenario/yaml_tree.h"
#include "harness/score/metrics.h"

namespace tiltproof::harness {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

const fs::path kSource = TILTPROOF_SOURCE_DIR;

std::string ReadFile(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::stringstream text;
  text << in.rdbuf();
  return text.str();
}

Json ToJson(const YamlNode& node) {
  switch (node.kind) {
    case YamlNode::Kind::kNull:
      return nullptr;
    case YamlNode::Kind::kBool:
      return node.boolean();
    case YamlNode::Kind::kNumber:
      if (const auto integer = node.Integer()) return *integer;
      return node.Number().value_or(1e308);
    case YamlNode::Kind::kText:
    case YamlNode::Kind::kAmbiguous:
      return node.text;
    case YamlNode::Kind::kSequence: {
      Json list = Json::array();
      for (const auto& item : node.items) list.push_back(ToJson(item));
      return list;
    }
    case YamlNode::Kind::kMapping: {
      Json object = Json::object();
      for (const auto& entry : node.entries) object[entry.key] = ToJson(entry.value);
      return object;
    }
  }
  return nullptr;
}

class SchemaTest : public testing::Test {
 protected:
  SchemaTest()
      : folder_(fs::path(testing::TempDir()) /
                (std::string("tiltproof_schema_") +
                 testing::UnitTest::GetInstance()->current_test_info()->name())) {
    fs::create_directories(folder_);
    options_.models_folder = kSource / "plant/models";
    options_.firmware_names = {"paper", "paper_published", "tolerant"};
    options_.metric_names = MetricNames();
  }

  // The reader's judgement. Models are searched, formulas not looked at, as the schema cannot.
  bool Reads(const fs::path& file) {
    try {
      ReadScenario(file, options_);
      return true;
    } catch (const ScenarioError& error) {
      message_ = error.what();
      return false;
    }
  }

  void AddCase(const std::string& name, const std::string& yaml, bool valid) {
    std::vector<YamlProblem> problems;
    const auto root = ParseYaml(yaml, problems);
    ASSERT_TRUE(root && problems.empty()) << yaml;
    cases_.push_back({{"name", name}, {"valid", valid}, {"instance", ToJson(*root)}});
  }

  // Runs the validator over the cases; its output is shown when it disagrees.
  void ExpectAgreement() {
    std::ofstream(folder_ / "schema.json") << ScenarioJsonSchema(options_.metric_names);
    std::ofstream(folder_ / "cases.json") << cases_.dump();
    const std::string command = std::string(TILTPROOF_PYTHON) + " " +
                                (kSource / "tests/harness/scenario/check_schema.py").string() + " " +
                                (folder_ / "schema.json").string() + " " + (folder_ / "cases.json").string();
    EXPECT_EQ(std::system(command.c_str()), 0) << command;
  }

  fs::path folder_;
  ReadOptions options_;
  std::string message_;
  Json cases_ = Json::array();
};

TEST_F(SchemaTest, ShippedScenariosAreValidForBoth) {
  const auto files = FindScenarios({kSource / "scenarios"}).Paths();
  ASSERT_GE(files.size(), 40U);
  for (const fs::path& file : files) {
    EXPECT_TRUE(Reads(file)) << message_;
    AddCase(file.string(), ReadFile(file), true);
  }
  EXPECT_NO_THROW(ReadScenarios(files, options_));
  ExpectAgreement();
}

TEST_F(SchemaTest, ResolvedScenariosAreValidForBoth) {
  for (const fs::path& file : FindScenarios({kSource / "scenarios"}).Paths()) {
    const std::string resolved = WriteResolved(ReadScenario(file, options_));
    std::ofstream(folder_ / "resolved.yaml") << resolved;
    EXPECT_TRUE(Reads(folder_ / "resolved.yaml")) << message_;
    AddCase(file.string(), resolved, true);
  }
  ExpectAgreement();
}

TEST_F(SchemaTest, BrokenScenariosAreRefusedByBoth) {
  const std::string good = "name: x\nduration_s: 24\nreference: {type: spiral}\n";
  const std::vector<std::string> broken = {
      "duration_s: 24\nreference: {type: spiral}\n",
      "name: x\nreference: {type: spiral}\n",
      "name: x\nduration_s: 24\n",
      "name: ../x\nduration_s: 24\nreference: {type: spiral}\n",
      "name: 5\nduration_s: 24\nreference: {type: spiral}\n",
      "name: x\nduration_s: 0\nreference: {type: spiral}\n",
      "name: x\nduration_s: \"24\"\nreference: {type: spiral}\n",
      "name: x\nduration_s: 24\nreference: spiral\n",
      "name: x\nduration_s: 24\nreference: {type: spirl}\n",
      "name: x\nduration_s: 24\nreference: {velocity: true}\n",
      "name: x\nduration_s: 24\nreference: {type: hover}\n",
      "name: x\nduration_s: 24\nreference: {type: hover, at_m: [0, 0]}\n",
      "name: x\nduration_s: 24\nreference: {type: hover, at_m: [0, 0, 2], radius_m: 3}\n",
      "name: x\nduration_s: 24\nreference: {type: waypoints, points_m: []}\n",
      "name: x\nduration_s: 24\nreference: {type: line, from_m: [0, 0, 1]}\n",
      good + "sed: 1\n",
      good + "seed: -1\n",
      good + "seed: 1.5\n",
      good + "seed: abc\n",
      good + "step_s: 1.5\n",
      good + "expect: maybe\n",
      good + "expect: {}\n",
      good + "expect: {paper: maybe}\n",
      good + "expect: {Paper!: fail}\n",
      good + "expect: {paper: {tolerant: fail}}\n",
      good + "description: true\n",
      good + "description: \"\"\n",
      good + "tags: wire\n",
      good + "tags: [a, 5]\n",
      good + "tags: [\"a b\"]\n",
      good + "allow_invalid_inertia: \"yes\"\n",
      good + "angular_rates: earth\n",
      good + "firmware: Paper!\n",
      good + "link: {baud: 100}\n",
      good + "link: {dialect: klingon}\n",
      good + "link: {protocol: klingon}\n",
      good + "link: {dialect: paper, protocol: paper}\n",
      good + "link: {ideal: 1}\n",
      good + "initial: {position_m: [0, 0, 5000]}\n",
      good + "initial: {attitude: [0, 0, 0]}\n",
      good + "faults: {id: a}\n",
      good + "faults: [{id: a}]\n",
      good + "faults: [{id: a, type: wire.bit_eror, target: both, parameters: {ber: 0}}]\n",
      good + "faults: [{id: a, type: wire.bit_error, target: both}]\n",
      good + "faults: [{id: a, type: wire.bit_error, parameters: {ber: 0}}]\n",
      good + "faults: [{id: a, type: wire.bit_error, target: up, parameters: {ber: 0}}]\n",
      good + "faults: [{id: a, type: wire.bit_error, target: both, parameters: {ber: 2}}]\n",
      good + "faults: [{id: a, type: wire.bit_error, target: both, parameters: {ber: 0, len: 1}}]\n",
      good + "faults: [{id: a, type: wire.bit_error, target: both, message: hello, parameters: {ber: 0}}]\n",
      good + "faults: [{id: a, type: sensor.freeze, target: both, parameters: {signal: z_m}}]\n",
      good + "faults: [{id: a, type: sensor.freeze, parameters: {signal: \"flight level\"}}]\n",
      good + "faults: [{id: a, type: harness.null, probability: 2}]\n",
      good + "faults: [{id: a, type: harness.null, every_nth_count: 0}]\n",
      good + "faults: [{id: a, type: node.kill, parameters: {node: plant}}]\n",
      good + "faults: [{id: a, type: node.kill, start_s: -1, parameters: {node: plant}}]\n",
      good + "faults: [{id: a, type: node.kill, start_s: 1, end_s: 2, parameters: {node: plant}}]\n",
      good + "faults: [{id: a, type: node.kill, start_s: 1, target: both, parameters: {node: plant}}]\n",
      good + "faults: [{id: a, type: node.kill, start_s: 1, probability: 1, parameters: {node: plant}}]\n",
      good + "faults: [{id: a, type: node.pause, start_s: 1, parameters: {node: plant}}]\n",
      good + "faults: [{id: a, type: node.restart, start_s: 1, parameters: {node: plant, down_ms: 1}}]\n",
      good + "faults: [{id: a, type: dds.loss, start_s: 1, parameters: {node: all, probability: 0.1}}]\n",
      good + "faults: [{id: a, type: device.hang}]\n",
      good + "faults: [{id: a, type: device.reset, start_s: 1}]\n",
      good + "faults: [{id: a, type: device.bit_flip, start_s: 1, parameters: {region: \"\"}}]\n",
      good + "faults: [{id: a, type: device.bit_flip, start_s: 1, parameters: {region: \"ram \"}}]\n",
      good + "faults: [{id: a, type: device.bit_flip, start_s: 1, parameters: {region: 5}}]\n",
      good + "faults: [{id: a, type: device.bit_flip, start_s: 1, parameters: {region: a, bit_count: 65}}]\n",
      good + "faults: [{id: a, type: clock.drift, target: both, parameters: {ppm: 1}}]\n",
      good + "faults: [{id: a, type: uart.overrun, target: both, parameters: {probability: 1}}]\n",
      good + "criteria: [{stl: \"true\"}]\n",
      good + "criteria: [{name: a, stl: 5}]\n",
      good + "criteria: [{name: a, metric: Rmse, max: 1}]\n",
      good + "criteria: [{name: a, metric: tracking.rmse_m, max: one}]\n",
      good + "criteria: [{name: a}]\n",
      good + "criteria: [{name: a, max: 1}]\n",
      good + "criteria: [{name: a, metric: tracking.rmse_m}]\n",
      good + "criteria: [{name: a, metric: tracking.rmse, max: 1}]\n",
      good + "criteria: [{name: a, stl: \"true\", max: 1}]\n",
      good + "criteria: [{name: a, stl: \"true\", metric: tracking.rmse_m, max: 1}]\n",
      good + "criteria: [{name: survival, stl: \"true\"}]\n",
      good + "criteria: [{name: control_period, stl: \"true\"}]\n",
      "name: results.json\nduration_s: 24\nreference: {type: spiral}\n",
  };
  std::ofstream(folder_ / "good.yaml") << good;
  EXPECT_TRUE(Reads(folder_ / "good.yaml")) << message_;
  AddCase("good", good, true);
  for (const std::string& yaml : broken) {
    std::ofstream(folder_ / "broken.yaml") << yaml;
    EXPECT_FALSE(Reads(folder_ / "broken.yaml")) << yaml;
    AddCase(yaml, yaml, false);
  }
  ExpectAgreement();
}

// An example of every fault there is, as the registry gives it.
TEST_F(SchemaTest, EveryFaultTypeIsKnownToBoth) {
  for (const faults::FaultType& type : faults::FaultTypes()) {
    Json parameters = Json::object();
    for (const auto& info : type.parameters) {
      std::visit([&](const auto& value) { parameters[std::string(info.name)] = value; }, info.example);
      // Whole numbers without ".0".
      if (info.kind == faults::ParameterKind::kInteger) {
        parameters[std::string(info.name)] = static_cast<std::int64_t>(std::get<double>(info.example));
      }
    }
    Json fault = {{"id", "a"}, {"type", type.name}, {"parameters", parameters}};
    if (type.has_target()) fault["target"] = "to_client";
    if (type.start == faults::Bound::kRequired) fault["start_s"] = 2;
    if (type.end == faults::Bound::kRequired) fault["end_s"] = 3;
    const Json scenario = {{"name", "x"},
                           {"duration_s", 24},
                           {"reference", {{"type", "spiral"}}},
                           {"faults", Json::array({fault})}};
    std::ofstream(folder_ / "fault.yaml") << scenario.dump();  // JSON is YAML
    EXPECT_TRUE(Reads(folder_ / "fault.yaml")) << message_;
    AddCase(std::string(type.name), scenario.dump(), true);
  }
  ExpectAgreement();
}

// What an editor offers and shows does not depend on what else is written already.
TEST_F(SchemaTest, EditorsCompleteEveryFaultType) {
  const Json schema = Json::parse(ScenarioJsonSchema(options_.metric_names));
  const Json& fault = schema["properties"]["faults"]["items"]["else"];
  EXPECT_FALSE(fault.contains("oneOf"));
  const Json& offered = fault["properties"]["type"]["oneOf"];
  ASSERT_EQ(offered.size(), faults::FaultTypes().size());
  ASSERT_EQ(fault["allOf"].size(), faults::FaultTypes().size());
  for (std::size_t i = 0; i < offered.size(); ++i) {
    const faults::FaultType& type = faults::FaultTypes()[i];
    EXPECT_EQ(offered[i], Json({{"const", type.name}, {"description", type.summary}}));
    const Json& branch = fault["allOf"][i];
    EXPECT_EQ(branch["if"]["properties"]["type"]["const"], type.name);
    const Json& keys = branch["then"]["properties"];
    EXPECT_TRUE(keys.contains("id")) << type.name;
    EXPECT_EQ(keys["type"]["description"], type.summary);
    ASSERT_EQ(keys["parameters"]["properties"].size(), type.parameters.size()) << type.name;
    for (const auto& parameter : type.parameters)
      EXPECT_EQ(keys["parameters"]["properties"][std::string(parameter.name)]["description"], parameter.doc);
  }
}

TEST_F(SchemaTest, DocumentationHasTheTables) {
  EXPECT_NE(ReadFile(kSource / "docs/scenario.md").find(ScenarioKeysMarkdown()), std::string::npos)
      << "docs/scenario.md lacks these tables:\n"
      << ScenarioKeysMarkdown();
}

}  // namespace
}  // namespace tiltproof::harness
