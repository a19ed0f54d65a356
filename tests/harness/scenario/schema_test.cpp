// The JSON Schema and the reader agree: judged by an independent validator, python3-jsonschema, on what the
// YAML says.
#include "harness/scenario/schema.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "faults/registry.h"
#include "harness/scenario/compound.h"
#include "harness/scenario/keys.h"
#include "harness/scenario/mapping_reader.h"
#include "harness/scenario/protocol_file.h"
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
    options_.firmware_names = {"paper", "paper_published", "tolerant", "failover", "triplex", "lqr"};
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
  void ExpectAgreement() { ExpectAgreement(ScenarioJsonSchema(options_.metric_names, {})); }
  void ExpectAgreement(const std::string& schema) {
    std::ofstream(folder_ / "schema.json") << schema;
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
      good + "faults: [{id: a, type: wire.bit_error, target: both, parameters: {ber: 2}}]\n",
      good + "faults: [{id: a, type: wire.bit_error, target: both, parameters: {ber: 0, len: 1}}]\n",
      good + "faults: [{id: a, type: wire.bit_error, target: both, message: '7 a', parameters: {ber: 0}}]\n",
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

// A target may be a line between boards, and the schema knows no other key's names.
TEST_F(SchemaTest, OnlyTheReaderRefusesATargetThatIsNoLine) {
  for (const char* fault : {"type: wire.bit_error, target: up, parameters: {ber: 0}",
                            "type: uart.overrun, target: both, parameters: {probability: 1}"}) {
    const std::string yaml =
        "name: x\nduration_s: 24\nreference: {type: spiral}\nfaults: [{id: a, " + std::string(fault) + "}]\n";
    std::ofstream(folder_ / "fault.yaml") << yaml;
    EXPECT_FALSE(Reads(folder_ / "fault.yaml")) << yaml;
    AddCase(yaml, yaml, true);
  }
  ExpectAgreement();
}

// A scenario with an example of that fault, as the registry gives it.
Json WithFault(const faults::FaultType& type) {
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
  return {{"name", "x"},
          {"duration_s", 24},
          {"reference", {{"type", "spiral"}}},
          {"faults", Json::array({fault})}};
}

TEST_F(SchemaTest, EveryFaultTypeIsKnownToBoth) {
  for (const faults::FaultType& type : faults::FaultTypes()) {
    const Json scenario = WithFault(type);
    std::ofstream(folder_ / "fault.yaml") << scenario.dump();  // JSON is YAML
    // The schema knows all types, the reader also what the frames of the scenario's protocol have.
    EXPECT_EQ(Reads(folder_ / "fault.yaml"), type.name != "frame.length_error") << message_;
    AddCase(std::string(type.name), scenario.dump(), true);
  }
  ExpectAgreement();
}

// Editors offer and explain the same types of faults, whatever else is written already.
TEST_F(SchemaTest, EditorsCompleteEveryFaultType) {
  const Json schema = Json::parse(ScenarioJsonSchema(options_.metric_names, {}));
  const Json& definitions = schema["$defs"];
  const Json& offered = definitions["fault type"]["oneOf"];
  ASSERT_EQ(offered.size(), faults::FaultTypes().size());
  for (const Json& fault : {schema["properties"]["faults"]["items"],
                            definitions["compound"]["properties"]["compound"]["items"]}) {
    EXPECT_FALSE(fault.contains("oneOf"));
    EXPECT_EQ(fault["properties"]["type"]["$ref"], "#/$defs/fault type");
    for (std::size_t i = 0; i < offered.size(); ++i) {
      const std::string type(faults::FaultTypes()[i].name);
      const Json& branch = fault["allOf"][i];
      EXPECT_EQ(branch["if"]["properties"]["type"]["const"], type);
      EXPECT_EQ(branch["if"]["type"], "object") << "an empty place is of no type";
      EXPECT_NE(branch["then"].dump().find("#/$defs/" + type), std::string::npos);
    }
  }
  for (std::size_t i = 0; i < offered.size(); ++i) {
    const faults::FaultType& type = faults::FaultTypes()[i];
    EXPECT_EQ(offered[i], Json({{"const", type.name}, {"description", type.summary}}));
    const Json& keys = definitions[std::string(type.name)]["properties"];
    EXPECT_TRUE(keys.contains("id")) << type.name;
    ASSERT_EQ(keys["parameters"]["properties"].size(), type.parameters.size()) << type.name;
    for (const auto& parameter : type.parameters) {
      const Json& shown = keys["parameters"]["properties"][std::string(parameter.name)];
      const std::string text = shown["description"];
      EXPECT_EQ(shown["title"], std::string(parameter.name) + " of " + std::string(type.name));
      EXPECT_EQ(text.find(parameter.doc), 0U) << text;
      EXPECT_TRUE(parameter.unit == "1" || text.find(parameter.unit) != std::string::npos) << text;
    }
  }
}

// Protocol files, too: the shipped ones, and mistakes in one of them.
TEST_F(SchemaTest, ProtocolFilesAreJudgedAlike) {
  for (const auto& entry : fs::directory_iterator(kSource / "link/protocols"))
    AddCase(entry.path().string(), ReadFile(entry.path()), true);
  EXPECT_GE(cases_.size(), 3U);
  const std::string one =
      "protocol: x\ncontrol_period_ms: 4\nframing: {type: cobs, check: sum8}\nstart: {first: motors}\n"
      "messages:\n"
      "  - {name: motors, from: client, fields: [{signal: f_n, type: u16, scale: 0.1}]}\n";
  const auto with = [&](std::string_view from, std::string_view to) {
    std::string text = one;
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return text.replace(at, from.size(), to);
  };
  AddCase("good", one, true);
  for (const std::string& yaml :
       {with("protocol: x", "protocol: 7x"), with("control_period_ms: 4\n", ""),
        with("control_period_ms: 4", "control_period_ms: 0"), with("type: cobs", "type: slip"),
        with("check: sum8", "check: crc8"), with("check: sum8", "check: sum8, sync: [1]"),
        with("type: cobs", "type: length_prefixed"), with("first: motors", "first: motors, message: go"),
        with("{first: motors}", "{}"), with("type: u16", "type: u64"), with("scale: 0.1", "scale: 0"),
        with("scale: 0.1", "offset: 0.1"), with("from: client", "from: plant"),
        with("start:", "exchange: push\nstart:"), with("messages:", "mesages:")}) {
    std::vector<YamlProblem> problems;
    const auto root = ParseYaml(yaml, problems);
    ASSERT_TRUE(root && problems.empty()) << yaml;
    ProtocolSpec spec;
    MappingReader reader(*root, problems);
    DescribeProtocol(reader, spec);
    reader.Finish();
    EXPECT_FALSE(problems.empty()) << yaml;
    AddCase(yaml, yaml, false);
  }
  ExpectAgreement(ProtocolJsonSchema());
}

// Everything that a mistake may leave in place of a value, and each place where one may be made.
class Mistakes {
 public:
  explicit Mistakes(std::uint32_t seed) : random_(seed) {}

  // `scenario` with one mistake, which need not make it wrong.
  Json In(const Json& scenario) {
    Json changed = scenario;
    const Json leaves = changed.flatten();
    std::vector<Json::json_pointer> places;
    for (const auto& leaf : leaves.items())
      for (Json::json_pointer place(leaf.key()); !place.empty(); place.pop_back()) places.push_back(place);
    const Json::json_pointer place = places[Below(places.size())];
    Json& parent = changed[place.parent_pointer()];
    switch (Below(4)) {
      case 0:
        if (parent.is_object()) {
          parent.erase(place.back());
          break;
        }
        [[fallthrough]];
      case 1:
        if (parent.is_object()) {
          parent["mistaken"] = 1;
          break;
        }
        [[fallthrough]];
      default: {
        static const Json kValues = {
            "mistaken",    "to_client",      -1,        0.5,           1,
            1000000000000, -1000000000000.5, true,      Json::array(), Json::object(),
            {1, 2, 3},     {1, "two", 3},    {0.5, 0.5}};
        changed[place] = kValues[Below(kValues.size())];
      }
    }
    return changed;
  }

 private:
  std::size_t Below(std::size_t count) { return random_() % count; }
  std::mt19937 random_;
};

// Keys, types, ranges, words and what is required: all that the reader asks before it opens other files and compares names.
bool KeysAreGood(const std::string& yaml) {
  std::vector<YamlProblem> problems;
  std::optional<YamlNode> root = ParseYaml(yaml, problems);
  if (!root || root->kind != YamlNode::Kind::kMapping) return false;
  ResolveCompounds(*root, problems);
  Scenario scenario;
  MappingReader reader(*root, problems);
  DescribeScenario(reader, scenario);
  reader.Finish();
  return problems.empty();
}

TEST_F(SchemaTest, MistakesAreRefusedByBothOrNeither) {
  std::vector<Json> scenarios;
  for (const faults::FaultType& type : faults::FaultTypes()) scenarios.push_back(WithFault(type));
  for (const fs::path& file : FindScenarios({kSource / "scenarios"}).Paths()) {
    std::vector<YamlProblem> problems;
    scenarios.push_back(ToJson(*ParseYaml(ReadFile(file), problems)));
  }
  Mistakes mistakes(1);
  std::size_t good_count = 0;
  for (const Json& scenario : scenarios) {
    for (int i = 0; i < 3; ++i) {
      const Json mistaken = mistakes.In(scenario);
      const std::string yaml = mistaken.dump();  // JSON is YAML
      const bool good = KeysAreGood(yaml);
      // A begin that neither a compound nor its member states: only the reader puts the two together.
      if (!good && yaml.find("compound") != std::string::npos) continue;
      // The reader compares the names of metrics later.
      if (yaml.find("\"metric\"") != std::string::npos) continue;
      good_count += good ? 1 : 0;
      cases_.push_back({{"name", yaml}, {"valid", good}, {"instance", mistaken}});
    }
  }
  EXPECT_GE(cases_.size(), 500U);
  EXPECT_GE(good_count, 80U);
  EXPECT_GE(cases_.size() - good_count, 250U);
  ExpectAgreement();
}

TEST_F(SchemaTest, DocumentationHasTheTables) {
  EXPECT_NE(ReadFile(kSource / "docs/scenario.md").find(ScenarioKeysMarkdown()), std::string::npos)
      << "docs/scenario.md lacks these tables:\n"
      << ScenarioKeysMarkdown();
}

}  // namespace
}  // namespace tiltproof::harness
