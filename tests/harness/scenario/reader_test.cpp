#include "harness/scenario/reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cctype>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace tiltproof::harness {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;

class ReaderTest : public testing::Test {
 protected:
  ReaderTest() {
    const char* name = testing::UnitTest::GetInstance()->current_test_info()->name();
    folder_ = fs::path(testing::TempDir()) / (std::string("tiltproof_reader_") + name);
    fs::remove_all(folder_);
    fs::create_directories(folder_ / "models");
    Write("models/tiltrotor.sdf", "<sdf/>");
    Write("models/tiltrotor_published.sdf", "<sdf/>");
    options_.models_folder = folder_ / "models";
    options_.firmware_names = {"paper", "paper_published", "tolerant"};
    options_.metric_names = {"tracking.rmse_m", "tracking.max_error_m", "link.accepted_wrong_count"};
    options_.check_formula = [](std::string_view formula,
                                const Scenario& scenario) -> std::optional<FormulaProblem> {
      // A language of two sentences, enough to see places and fault ids handed through.
      if (const auto at = formula.find("wrong"); at != std::string_view::npos)
        return FormulaProblem{at + 1, "wrong"};
      if (formula == "first fault")
        return scenario.faults.empty() ? std::optional(FormulaProblem{1, "no fault"}) : std::nullopt;
      return std::nullopt;
    };
  }
  ~ReaderTest() override { fs::remove_all(folder_); }

  fs::path Write(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name, std::ios::binary) << text;
    return folder_ / name;
  }

  Scenario Read(const std::string& text) { return ReadScenario(Write("scenario.yaml", text), options_); }

  // A scenario in order, three lines long, with more lines below.
  static std::string With(const std::string& more) {
    return "name: x\nduration_s: 24\nreference: {type: hover, at_m: [0, 0, 2]}\n" + more;
  }

  // "line:column: message" of each diagnostic.
  std::vector<std::string> Errors(const std::string& text) {
    try {
      Read(text);
    } catch (const ScenarioError& error) {
      std::vector<std::string> lines;
      for (const Diagnostic& d : error.diagnostics()) {
        EXPECT_EQ(d.file, folder_ / "scenario.yaml");
        lines.push_back(ToString(d).substr(d.file.string().size() + 1));
      }
      return lines;
    }
    return {};
  }
  std::vector<std::string> ErrorsWith(const std::string& more) { return Errors(With(more)); }

  fs::path folder_;
  ReadOptions options_;
};

TEST_F(ReaderTest, FillsInDefaults) {
  const Scenario s = Read(With(""));
  EXPECT_EQ(s.file, folder_ / "scenario.yaml");
  EXPECT_EQ(s.name, "x");
  EXPECT_EQ(s.description, "");
  EXPECT_TRUE(s.tags.empty());
  EXPECT_EQ(s.model, "tiltrotor");
  EXPECT_EQ(s.model_file, folder_ / "models/tiltrotor.sdf");
  EXPECT_EQ(s.firmware, "paper");
  EXPECT_EQ(s.expected(), Verdict::kPass);
  EXPECT_EQ(s.seed, 1U);
  EXPECT_EQ(s.duration_ns, 24 * kNsPerS);
  EXPECT_EQ(s.step_ns, 4 * kNsPerMs);
  EXPECT_EQ(s.angular_rates, AngularRates::kWorld);
  EXPECT_FALSE(s.allow_invalid_inertia);
  EXPECT_THAT(s.initial_position_m, ElementsAre(0, 0, 2));
  EXPECT_THAT(s.initial_attitude_rad, ElementsAre(0, 0, 0));
  EXPECT_FALSE(s.link.ideal);
  EXPECT_EQ(s.link.baud, 921'600);
  EXPECT_EQ(link::Name(s.link.character), "8N1");
  EXPECT_EQ(s.link.protocol->name, "paper");
  EXPECT_EQ(s.link.adapter_latency_ms, 0.0);
  EXPECT_TRUE(s.reference.velocity);
  EXPECT_TRUE(s.faults.empty());
  EXPECT_TRUE(s.criteria.empty());
}

TEST_F(ReaderTest, ReadsEveryKey) {
  const Scenario s = Read(R"yaml(name: spiral-burst-errors
description: >-
  Two
  lines.
tags: [wire, "on"]
model: tiltrotor_published
allow_invalid_inertia: true
firmware: tolerant
expect: inconclusive
seed: 7
duration_s: 60.5
step_s: 0.003
angular_rates: body
initial: {position_m: [2, 0, 0.25], attitude_rad: [0.1, -0.2, 3]}
link: {ideal: true, baud: 115200, reference_baud: 57600, data_bits: 7, parity: odd, stop_bits: 2, dialect: provant, adapter_latency_ms: 1.5}
reference: {type: spiral, turns_count: 2, radius_m: 4, height_m: -1, start_m: [1, 2, 3], velocity: false, time_s: 30}
faults:
  - {id: bursts, type: wire.gilbert_elliott, target: to_client, start_s: 20, end_s: 25.000000001,
     parameters: {p_bad: 0.001, p_good: 0.1, ber_good: 0, ber_bad: 0.02}}
  - {id: late, type: frame.delay, target: to_plant, message: actuators, every_nth_count: 3, probability: 0.5,
     parameters: {mean_ms: 5, distribution: uniform}}
  - {id: drift, type: sensor.bias, parameters: {signal: z_m, offset: 0.5}}
criteria:
  - {name: a, stl: "always(true)"}
  - {name: b, metric: tracking.rmse_m, min: -1, max: 2.5}
)yaml");
  EXPECT_EQ(s.description, "Two lines.");
  EXPECT_THAT(s.tags, ElementsAre("wire", "on"));
  EXPECT_EQ(s.model_file, folder_ / "models/tiltrotor_published.sdf");
  EXPECT_TRUE(s.allow_invalid_inertia);
  EXPECT_EQ(s.firmware, "tolerant");
  EXPECT_EQ(s.expected(), Verdict::kInconclusive);
  EXPECT_EQ(s.seed, 7U);
  EXPECT_EQ(s.duration_ns, 60'500 * kNsPerMs);
  EXPECT_EQ(s.step_ns, 3 * kNsPerMs);
  EXPECT_EQ(s.angular_rates, AngularRates::kBody);
  EXPECT_THAT(s.initial_position_m, ElementsAre(2, 0, 0.25));
  EXPECT_THAT(s.initial_attitude_rad, ElementsAre(0.1, -0.2, 3));
  EXPECT_TRUE(s.link.ideal);
  EXPECT_EQ(s.link.baud, 115'200);
  EXPECT_EQ(s.link.reference_baud, 57'600);
  EXPECT_EQ(link::Name(s.link.character), "7O2");
  EXPECT_EQ(s.link.protocol->name, "provant");
  EXPECT_EQ(s.link.adapter_latency_ms, 1.5);
  EXPECT_FALSE(s.reference.velocity);
  const auto& spiral = std::get<SpiralReference>(s.reference.path);
  EXPECT_EQ(spiral.turns_count, 2);
  EXPECT_EQ(spiral.radius_m, 4);
  EXPECT_EQ(spiral.height_m, -1);
  EXPECT_THAT(spiral.start_m, ElementsAre(1, 2, 3));
  EXPECT_EQ(spiral.time_s, 30);
  ASSERT_EQ(s.faults.size(), 3U);
  EXPECT_EQ(s.faults[0].type, "wire.gilbert_elliott");
  EXPECT_EQ(s.faults[0].target, faults::Target::kToClient);
  EXPECT_EQ(s.faults[0].start_ns, 20 * kNsPerS);
  EXPECT_EQ(s.faults[0].end_ns, 25 * kNsPerS + 1);
  EXPECT_EQ(std::get<double>(s.faults[0].parameters.at("ber_bad")), 0.02);
  EXPECT_EQ(s.faults[1].start_ns, kPowerOn);
  EXPECT_EQ(s.faults[1].end_ns, kNever);
  EXPECT_EQ(s.faults[1].message, "actuators");
  EXPECT_EQ(s.faults[1].every_nth_count, 3);
  EXPECT_EQ(s.faults[1].probability, 0.5);
  EXPECT_EQ(std::get<std::string>(s.faults[1].parameters.at("distribution")), "uniform");
  EXPECT_EQ(std::get<double>(s.faults[1].parameters.at("jitter_ms")), 0.0);
  EXPECT_EQ(s.faults[2].target, faults::Target::kNone);
  EXPECT_EQ(std::get<std::string>(s.faults[2].parameters.at("signal")), "z_m");
  ASSERT_EQ(s.criteria.size(), 2U);
  EXPECT_EQ(s.criteria[0].stl, "always(true)");
  EXPECT_EQ(s.criteria[1].metric, "tracking.rmse_m");
  EXPECT_EQ(s.criteria[1].min, -1);
  EXPECT_EQ(s.criteria[1].max, 2.5);
}

TEST_F(ReaderTest, ReadsEveryReferenceAndStartsThere) {
  Write("path.csv", "t_s,x_m,y_m,z_m,yaw_rad\n0,7,8,9,0\n1,7,8,10,0\n");
  const std::vector<std::pair<std::string, std::array<double, 3>>> cases = {
      {"{type: hover, at_m: [1, 2, 3], yaw_rad: 0.5}", {1, 2, 3}},
      {"{type: spiral}", {2, 0, 0.5}},
      {"{type: waypoints, points_m: [[1, 1, 1], [2, 2, 2]], speed_m_s: 0.5}", {1, 1, 1}},
      {"{type: circle, radius_m: 2, period_s: 30, start_m: [1, 0, 2]}", {1, 0, 2}},
      {"{type: eight, width_m: 2, period_s: 30, start_m: [1, 0, 2]}", {1, 0, 2}},
      {"{type: line, from_m: [0, 0, 1], to_m: [5, 0, 1], time_s: 10}", {0, 0, 1}},
      {"{type: recorded, file: path.csv}", {7, 8, 9}},
  };
  for (std::size_t i = 0; i < cases.size(); ++i) {
    const Scenario s = Read("name: x\nduration_s: 24\nreference: " + cases[i].first + "\n");
    EXPECT_EQ(s.reference.path.index(), i);
    EXPECT_EQ(s.initial_position_m, cases[i].second) << cases[i].first;
  }
  EXPECT_EQ(std::get<RecordedReference>(
                Read("name: x\nduration_s: 24\nreference: " + cases[6].first).reference.path)
                .file,
            folder_ / "path.csv");
}

TEST_F(ReaderTest, GroundEndsTheFlightOrCarriesTheVehicle) {
  EXPECT_FALSE(Read(With("")).solid_ground);
  EXPECT_FALSE(Read(With("ground: end\n")).solid_ground);
  const Scenario solid = Read(With("ground: {solid: true}\n"));
  EXPECT_EQ(solid.solid_ground, SolidGround{1});
  EXPECT_FALSE(solid.initial_on_ground);
  EXPECT_THAT(solid.initial_position_m, ElementsAre(0, 0, 2));
  const Scenario standing =
      Read(With("ground: {solid: true, touch_down_max_m_s: 0.4}\ninitial: {on_ground: true}\n"));
  EXPECT_EQ(standing.solid_ground, SolidGround{0.4});
  EXPECT_TRUE(standing.initial_on_ground);
  EXPECT_THAT(standing.initial_position_m, ElementsAre(0, 0, 0));
  EXPECT_THAT(Read(With("ground: {solid: true}\ninitial: {on_ground: true, position_m: [3, 4, 0]}\n"))
                  .initial_position_m,
              ElementsAre(3, 4, 0));
}

TEST_F(ReaderTest, GroundThatDoesNotFitIsRefused) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"ground: solid\n", "4:9: ground: expected 'end' or a mapping, found 'solid'"},
      {"ground: {touch_down_max_m_s: 2}\n", "4:9: missing key 'solid'"},
      {"ground: {solid: false}\n", "4:17: solid: false is `ground: end`: write that"},
      {"ground: {solid: true, touch_down_max_m_s: 0}\n",
       "4:43: touch_down_max_m_s: 0 is out of range; must be from 0.001 to 100"},
      {"ground: {solid: true, touch_down: 2}\n",
       "4:23: unknown key 'touch_down'; did you mean 'touch_down_max_m_s'?"},
      {"initial: {on_ground: true}\n",
       "4:22: on_ground: the ground ends the flight at any touch: add `ground: {solid: true}`"},
      {"ground: {solid: true}\ninitial: {on_ground: true, position_m: [0, 0, 0.5]}\n",
       "5:40: position_m: with `on_ground` the height follows from the vehicle's shapes: write 0 in place of "
       "z = "
       "0.5, or remove `on_ground`"},
  };
  for (const auto& [text, error] : cases) EXPECT_THAT(ErrorsWith(text), ElementsAre(error)) << text;
}

TEST_F(ReaderTest, ProtocolHasTwoNames) {
  const std::string head = "name: x\nduration_s: 24\nreference: {type: spiral}\n";
  EXPECT_EQ(Read(head + "link: {protocol: provant}\n").link, Read(head + "link: {dialect: provant}\n").link);
  EXPECT_EQ(Read(head + "link: {protocol: provant}\n").link.protocol->name, "provant");
  EXPECT_THAT(ErrorsWith("link: {protocol: paper, dialect: provant}\n"),
              ElementsAre("4:25: 'protocol' and 'dialect' are two names of one key: give one"));
  EXPECT_THAT(ErrorsWith("link: {protocol: papre}\n"),
              ElementsAre("4:18: protocol: unknown value 'papre'; did you mean 'paper'?"));
}

TEST_F(ReaderTest, NamesTheNearestKeyOrValue) {
  EXPECT_THAT(Errors("name: x\nduraton_s: 24\nreference: {type: spiral}\n"),
              ElementsAre("2:1: unknown key 'duraton_s'; did you mean 'duration_s'?"));
  EXPECT_THAT(ErrorsWith("expect: fial\n"),
              ElementsAre("4:9: expect: unknown value 'fial'; did you mean 'fail'?"));
  EXPECT_THAT(ErrorsWith("link: {buad: 9600}\n"),
              ElementsAre("4:8: unknown key 'buad'; did you mean 'baud'?"));
  EXPECT_THAT(ErrorsWith("model: tiltrotr\n"),
              ElementsAre("4:8: model: unknown model 'tiltrotr'; did you mean 'tiltrotor'?"));
  EXPECT_THAT(ErrorsWith("model: submarine\n"),
              ElementsAre("4:8: model: unknown model 'submarine'; valid: tiltrotor, tiltrotor_published"));
  EXPECT_THAT(ErrorsWith("firmware: tolerent\n"),
              ElementsAre("4:11: firmware: unknown build 'tolerent'; did you mean 'tolerant'?"));
  EXPECT_THAT(ErrorsWith("criteria: [{name: a, metric: tracking.rsme_m, max: 1}]\n"),
              ElementsAre("4:30: metric: unknown metric 'tracking.rsme_m'; did you mean 'tracking.rmse_m'?"));
  EXPECT_THAT(ErrorsWith("faults: [{id: a, type: wire.bit_eror, target: both, parameters: {ber: 0}}]\n"),
              ElementsAre("4:24: type: unknown value 'wire.bit_eror'; did you mean 'wire.bit_error'?"));
  EXPECT_THAT(ErrorsWith("faults: [{id: a, type: wire.bit_error, target: to_clint, parameters: {bre: 0}}]\n"),
              ElementsAre("4:48: target: unknown value 'to_clint'; did you mean 'to_client'?",
                          "4:71: unknown key 'bre'; did you mean 'ber'?"));
  EXPECT_THAT(Errors("name: x\nduration_s: 24\nreference: {type: spirl, whatever: 1}\n"),
              ElementsAre("3:19: type: unknown value 'spirl'; did you mean 'spiral'?"));
}

TEST_F(ReaderTest, WrongTypes) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"seed: abc\n", "4:7: seed: expected a number, found 'abc'"},
      {"seed: \"7\"\n", "4:7: seed: expected a number, found '7'"},
      {"seed: 1.5\n", "4:7: seed: expected a whole number without point and exponent, found 1.5"},
      {"seed: 010\n", "4:7: seed: '010': write the number without leading zeros"},
      {"seed: [1]\n", "4:7: seed: expected a number, found a list"},
      {"seed:\n", "4:1: seed: the value is missing"},
      {"step_s: true\n", "4:9: step_s: expected a number, found true"},
      {"step_s: .nan\n", "4:9: step_s: '.nan': only finite numbers are allowed"},
      {"link: {ideal: yes}\n", "4:15: ideal: 'yes': only true and false are truth values"},
      {"link: {ideal: 1}\n", "4:15: ideal: expected true or false, found the number 1"},
      {"link: 921600\n", "4:7: link: expected a mapping, found the number 921600"},
      {"link: [{baud: 9600}]\n", "4:7: link: expected a mapping, found a list"},
      {"description: 5\n",
       "4:14: description: expected text, found the number 5; put quotes around it if text is meant"},
      {"description: true\n",
       "4:14: description: expected text, found true; put quotes around it if text is meant"},
      {"description: \"\"\n", "4:14: description: the text is empty"},
      {"description: \"\\e[2J\"\n", "4:14: description: contains a control character"},
      {"tags: wire\n", "4:7: tags: expected a list, found 'wire'"},
      {"tags: [a, off]\n",
       "4:11: tags: 'off': only true and false are truth values; put quotes around it if text is meant"},
      {"tags: [a b]\n",
       "4:8: tags: 'a b' must be letters, digits, '_', '.', '-', beginning with a letter or digit"},
      {"expect: 1\n", "4:9: expect: expected one of pass, fail, inconclusive, error, found the number 1"},
      {"initial: {position_m: [0, 1]}\n",
       "4:23: position_m: expected a list of three numbers, found a list of 2"},
      {"initial: {position_m: 5}\n",
       "4:23: position_m: expected a list of three numbers, found the number 5"},
      {"initial: {position_m: [0, x, 1]}\n", "4:27: position_m: expected a number, found 'x'"},
      {"faults: {id: a}\n", "4:9: faults: expected a list, found a mapping"},
      {"faults: [a]\n", "4:10: faults: expected a mapping, found 'a'"},
      {"criteria: [[]]\n", "4:12: criteria: expected a mapping, found a list"},
  };
  for (const auto& [text, message] : cases) EXPECT_THAT(ErrorsWith(text), ElementsAre(message)) << text;
  for (const char* const model :
       {"<?xml version=\"1.0\"?>\n<sdf version=\"1.9\">\n", "\n<sdf version='1.9'>"})
    EXPECT_THAT(
        Errors(model),
        ElementsAre("1:1: a model (XML), and a YAML file is needed; `tiltproof vehicle` reads models"));
  EXPECT_THAT(Errors("- a\n"), ElementsAre("1:1: expected a mapping of keys to values, found a list"));
  EXPECT_THAT(Errors("just text"),
              ElementsAre("1:1: expected a mapping of keys to values, found 'just text'"));
  EXPECT_THAT(Errors("---\n...\n"),
              ElementsAre(HasSubstr("expected a mapping of keys to values, found nothing")));
}

TEST_F(ReaderTest, MissingKeys) {
  EXPECT_THAT(Errors("seed: 1\n"), ElementsAre("1:1: missing key 'name'", "1:1: missing key 'duration_s'",
                                               "1:1: missing key 'reference'"));
  EXPECT_THAT(Errors("name: x\nduration_s: 24\nreference: {velocity: true}\n"),
              ElementsAre("3:12: missing key 'type'"));
  EXPECT_THAT(Errors("name: x\nduration_s: 24\nreference: {type: line}\n"),
              ElementsAre("3:12: missing key 'from_m'", "3:12: missing key 'to_m'"));
  EXPECT_THAT(Errors("name: x\nduration_s: 24\nreference: {type: recorded}\n"),
              ElementsAre("3:12: missing key 'file'"));
  EXPECT_THAT(Errors("name: x\nduration_s: 24\nreference: {type: waypoints}\n"),
              ElementsAre("3:12: missing key 'points_m'"));
  EXPECT_THAT(ErrorsWith("faults: [{}]\n"),
              ElementsAre("4:10: missing key 'id'", "4:10: missing key 'type'"));
  EXPECT_THAT(ErrorsWith("faults: [{id: a, type: wire.bit_error}]\n"),
              ElementsAre("4:10: missing key 'target'", "4:10: missing key 'parameters'"));
  EXPECT_THAT(ErrorsWith("faults: [{id: a, type: wire.bit_error, target: both, parameters: {}}]\n"),
              ElementsAre("4:66: missing key 'ber'"));
  EXPECT_THAT(ErrorsWith("criteria: [{stl: \"x\"}]\n"), ElementsAre("4:12: missing key 'name'"));
}

TEST_F(ReaderTest, RangesAndNames) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"format: 2\n", "4:9: format: 2 is out of range; must be from 1 to 1"},
      {"seed: -1\n", "4:7: seed: -1 is out of range; must be from 0 to 9007199254740991"},
      {"seed: 9007199254740992\n",
       "4:7: seed: 9007199254740992 is out of range; must be from 0 to 9007199254740991"},
      {"seed: 1e999\n", "4:7: seed: 1e999 is out of range; must be from 0 to 9007199254740991"},
      {"step_s: 0\n", "4:9: step_s: 0 is out of range; must be from 1e-05 to 1"},
      {"step_s: 0.024\n", "4:9: step_s: 0.024 does not divide the control period of 0.012 s"},
      {"step_s: 0.005\n", "4:9: step_s: 0.005 does not divide the control period of 0.012 s"},
      {"step_s: 0.0040000001\n", "4:9: step_s: 0.0040000001 does not divide the control period of 0.012 s"},
      {"step_s: 0.00400000000001\n",
       "4:9: step_s: 0.00400000000001 does not divide the control period of 0.012 s"},
      {"link: {baud: 110}\n", "4:14: baud: 110 is out of range; must be from 1200 to 10000000"},
      {"link: {adapter_latency_ms: -1}\n",
       "4:28: adapter_latency_ms: -1 is out of range; must be from 0 to 1000"},
      {"initial: {position_m: [0, 0, 1e4]}\n",
       "4:30: position_m: 1e4 is out of range; must be from -1000 to 1000"},
      {"initial: {attitude_rad: [0, 90, 0]}\n",
       "4:29: attitude_rad: 90 is out of range; must be from -3.2 to 3.2"},
      {"firmware: ../evil\n", "4:11: firmware: '../evil' must be lower-case letters, digits and '_'"},
  };
  for (const auto& [text, message] : cases) EXPECT_THAT(ErrorsWith(text), ElementsAre(message)) << text;
  EXPECT_THAT(
      Errors("name: ../x\nduration_s: 24\nreference: {type: spiral}\n"),
      ElementsAre(
          "1:7: name: '../x' must be letters, digits, '_', '.', '-', beginning with a letter or digit"));
  EXPECT_THAT(Errors("name: " + std::string(101, 'a') + "\nduration_s: 24\nreference: {type: spiral}\n"),
              ElementsAre("1:7: name: longer than 100 bytes"));
  EXPECT_THAT(Errors("name: x\nduration_s: 0\nreference: {type: spiral}\n"),
              ElementsAre("2:13: duration_s: 0 is out of range; must be from 1e-05 to 14400"));
  EXPECT_THAT(Errors("name: x\nduration_s: 0.011\nreference: {type: spiral}\n"),
              ElementsAre("2:13: duration_s: 0.011 is shorter than the control period of 0.012 s"));
  EXPECT_THAT(Errors("name: x\nduration_s: 24\nreference: {type: waypoints, points_m: []}\n"),
              ElementsAre("3:40: points_m: the list is empty"));
  for (const std::string step : {"0.001", "0.002", "0.003", "0.004", "0.006", "0.012", "0.0005", "0.00025"}) {
    EXPECT_THAT(ErrorsWith("step_s: " + step + "\n"), ElementsAre()) << step;
  }
}

TEST_F(ReaderTest, FaultsThatMakeTooManyBytesTogether) {
  std::string faults = "faults:\n";
  for (int i = 0; i < 24; ++i)
    faults.append("  - {id: d")
        .append(std::to_string(i))
        .append(", type: wire.byte_duplicate, target: reference, parameters: {probability: 1}}\n");
  EXPECT_THAT(ErrorsWith(faults),
              ElementsAre(testing::AllOf(testing::StartsWith("23:10: id: together 'd0', 'd1', "),
                                         HasSubstr("'d18' make more than 8 MiB of each frame reference"))));
}

TEST_F(ReaderTest, SensorsIsAnotherWordForTheRequest) {
  for (const std::string word : {"request", "sensors"}) {
    const Scenario s = Read(With("faults: [{id: a, message: " + word +
                                 ", type: wire.bit_error, target: to_plant, parameters: {ber: 0.1}}]\n"));
    EXPECT_EQ(s.faults.at(0).message, "request");
    EXPECT_THAT(WriteResolved(s), HasSubstr("message: \"request\""));
  }
}

TEST_F(ReaderTest, FaultsInThemselvesAndTogether) {
  const std::string wire = "type: wire.bit_error, target: to_client, parameters: {ber: 0.1}";
  EXPECT_THAT(ErrorsWith("faults:\n  - {id: a, " + wire + "}\n  - {id: a, " + wire + "}\n"),
              ElementsAre("6:10: id: 'a' is taken already on line 5"));
  EXPECT_THAT(ErrorsWith("faults: [{id: a, start_s: 20, end_s: 10, " + wire + "}]\n"),
              ElementsAre(HasSubstr("4:38: end_s: ")));
  EXPECT_THAT(ErrorsWith("faults: [{id: a, start_s: 10, end_s: 10, " + wire + "}]\n"),
              ElementsAre(HasSubstr("4:38: end_s: ")));
  EXPECT_THAT(ErrorsWith("faults: [{id: a, start_s: 24, " + wire + "}]\n"),
              ElementsAre("4:27: start_s: the flight is over by then (duration_s)"));
  EXPECT_THAT(ErrorsWith("faults: [{id: a, message: actuators, " + wire + "}]\n"),
              ElementsAre(HasSubstr("4:27: message: ")));
  EXPECT_THAT(ErrorsWith("faults: [{id: a, probability: 1.5, every_nth_count: 0, " + wire + "}]\n"),
              ElementsAre("4:31: probability: 1.5 is out of range; must be from 0 to 1",
                          "4:53: every_nth_count: 0 is out of range; must be from 1 to 1000000000"));
  EXPECT_THAT(
      ErrorsWith("faults: [{id: a, type: wire.bit_error, target: to_client, parameters: {ber: 2}}]\n"),
      ElementsAre("4:77: ber: 2 is out of range; must be from 0 to 1"));
  EXPECT_THAT(
      ErrorsWith("faults: [{id: a, type: sensor.freeze, target: to_client, parameters: {signal: z_m}}]\n"),
      ElementsAre(HasSubstr("4:39: unknown key 'target'")));
  EXPECT_THAT(
      ErrorsWith("faults: [{id: a, type: frame.delay, target: both, parameters: {mean_ms: 1, "
                 "distribution: gauss}}]\n"),
      ElementsAre("4:90: distribution: unknown value 'gauss'; valid: constant, uniform, normal, pareto"));
  EXPECT_THAT(
      ErrorsWith(
          "faults: [{id: a, type: wire.burst, target: both, parameters: {length_bits: 1.5, density: 1, "
          "rate_hz: 1}}]\n"),
      ElementsAre("4:76: length_bits: expected a whole number without point and exponent, found 1.5"));
}

TEST_F(ReaderTest, Criteria) {
  EXPECT_THAT(ErrorsWith("criteria:\n  - {name: a, stl: x}\n  - {name: a, stl: z}\n"),
              ElementsAre("6:12: name: 'a' is taken already on line 5"));
  EXPECT_THAT(ErrorsWith("criteria: [{name: survival, stl: x}]\n"),
              ElementsAre("4:19: name: 'survival' is a criterion that every scenario has; choose another"));
  EXPECT_THAT(
      ErrorsWith("criteria: [{name: control_period, stl: x}]\n"),
      ElementsAre("4:19: name: 'control_period' is a criterion that every scenario has; choose another"));
  EXPECT_THAT(ErrorsWith("criteria: [{name: a}]\n"),
              ElementsAre("4:12: a criterion needs 'stl' or 'metric'"));
  EXPECT_THAT(ErrorsWith("criteria: [{name: a, stl: x, metric: tracking.rmse_m, max: 1}]\n"),
              ElementsAre("4:12: a criterion has either 'stl' or 'metric', not both"));
  EXPECT_THAT(ErrorsWith("criteria: [{name: a, metric: tracking.rmse_m}]\n"),
              ElementsAre("4:30: metric: needs 'min', 'max' or both"));
  EXPECT_THAT(ErrorsWith("criteria: [{name: a, metric: tracking.rmse_m, min: 2, max: 1}]\n"),
              ElementsAre("4:60: max: 1 is less than min, 2"));
  EXPECT_THAT(ErrorsWith("criteria: [{name: a, stl: x, max: 1}]\n"),
              ElementsAre("4:35: bounds belong to a 'metric'; write them into the formula"));
  EXPECT_THAT(ErrorsWith("criteria: [{name: a, max: 1}]\n"),
              ElementsAre("4:12: a criterion needs 'stl' or 'metric'"));
  EXPECT_THAT(ErrorsWith("criteria: [{name: a, metric: Rmse, max: 1}]\n"),
              ElementsAre("4:30: metric: 'Rmse' must be a dotted name such as tracking.rmse_m"));
}

TEST_F(ReaderTest, FormulaProblemsPointIntoTheFormula) {
  EXPECT_THAT(ErrorsWith("criteria: [{name: a, stl: \"is wrong\"}]\n"), ElementsAre("4:31: stl: wrong"));
  EXPECT_THAT(ErrorsWith("criteria: [{name: a, stl: is wrong}]\n"), ElementsAre("4:30: stl: wrong"));
  EXPECT_THAT(ErrorsWith("criteria: [{name: a, stl: 'é wrong'}]\n"), ElementsAre("4:30: stl: wrong"));
  EXPECT_THAT(ErrorsWith("criteria: [{name: a, stl: \"\\twrong\"}]\n"),
              ElementsAre("4:27: stl: column 2 of the formula: wrong"));
  EXPECT_THAT(ErrorsWith("criteria:\n  - name: a\n    stl: >-\n      is\n      wrong\n"),
              ElementsAre("6:10: stl: column 4 of the formula: wrong"));
  EXPECT_THAT(ErrorsWith("criteria: [{name: a, stl: first fault}]\n"), ElementsAre("4:27: stl: no fault"));
  EXPECT_THAT(ErrorsWith("faults: [{id: a, type: harness.null}]\ncriteria: [{name: a, stl: first fault}]\n"),
              ElementsAre());
}

TEST_F(ReaderTest, ModelFiles) {
  Write("own.sdf", "<sdf/>");
  const Scenario own = Read(With("model: own.sdf\n"));
  EXPECT_EQ(own.model, "own.sdf");
  EXPECT_EQ(own.model_file, folder_ / "own.sdf");
  EXPECT_EQ(Read(With("model: " + (folder_ / "own.sdf").string() + "\n")).model_file, folder_ / "own.sdf");
  EXPECT_THAT(ErrorsWith("model: other.sdf\n"),
              ElementsAre("4:8: model: there is no file " + (folder_ / "other.sdf").string()));
  EXPECT_THAT(ErrorsWith("model: ../models/tiltrotor\n"),
              ElementsAre(HasSubstr("4:8: model: there is no file")));
  EXPECT_THAT(ErrorsWith("model: tiltroto\n"),
              ElementsAre(HasSubstr("4:8: model: unknown model 'tiltroto'")));

  bool allowed = false;
  options_.check_model = [&](const fs::path& file, bool allow_invalid_inertia) -> std::optional<std::string> {
    allowed = allow_invalid_inertia;
    return file.stem() == "own" ? std::optional<std::string>("cannot fly") : std::nullopt;
  };
  EXPECT_THAT(ErrorsWith("model: own.sdf\n"), ElementsAre("4:8: model: cannot fly"));
  EXPECT_FALSE(allowed);
  EXPECT_THAT(ErrorsWith("allow_invalid_inertia: true\n"), ElementsAre());
  EXPECT_TRUE(allowed);
}

TEST_F(ReaderTest, RecordedReferenceIsOpened) {
  Write("bad.csv", "t_s,x_m,y_m,z_m,yaw_rad\n0,0,0,zero,0\n");
  const std::string start = "name: x\nduration_s: 24\nreference: {type: recorded, file: ";
  EXPECT_THAT(Errors(start + "bad.csv}\n"),
              ElementsAre("3:35: file: " + (folder_ / "bad.csv").string() + ":2: 'zero' is not a number"));
  EXPECT_THAT(Errors(start + "none.csv}\n"),
              ElementsAre("3:35: file: " + (folder_ / "none.csv").string() + ": not a readable file"));
}

TEST_F(ReaderTest, EveryFirmwareNameWillDoWithoutAList) {
  options_.firmware_names.clear();
  EXPECT_EQ(Read(With("firmware: my_own_2\n")).firmware, "my_own_2");
}

TEST_F(ReaderTest, DiagnosticsAreSortedAndLimited) {
  EXPECT_THAT(Errors("zz: 1\nseed: x\nname: 5\nduration_s: 24\nreference: {type: spiral}\nseed: 3\n"),
              ElementsAre(HasSubstr("1:1: unknown key 'zz'"), HasSubstr("2:7: seed:"),
                          HasSubstr("3:7: name:"), HasSubstr("6:1: duplicate key 'seed'")));
  std::string many;
  for (int i = 0; i < 30; ++i) many += "unknown_key_" + std::to_string(i) + ": 1\n";
  const auto errors = ErrorsWith(many);
  ASSERT_EQ(errors.size(), kDiagnosticsMax + 1);
  EXPECT_EQ(errors.back(), " and 10 more problems");
}

TEST_F(ReaderTest, FilesThatCannotBeRead) {
  for (const fs::path& path : {folder_ / "none.yaml", folder_}) {
    try {
      ReadScenario(path, options_);
      ADD_FAILURE();
    } catch (const ScenarioError& error) {
      EXPECT_EQ(std::string(error.what()), path.string() + ": no such file");
    }
  }
  EXPECT_THAT(Errors(std::string(2'000'000, '#')), ElementsAre("1:1: larger than 1024 KiB"));
}

TEST_F(ReaderTest, ScenariosOfOneRunHaveDifferentNames) {
  const fs::path a = Write("a.yaml", With("")), b = Write("b.yaml", With("")),
                 c = Write("c.yaml", With("seed: x\n"));
  try {
    ReadScenarios({a, b, c}, options_);
    ADD_FAILURE();
  } catch (const ScenarioError& error) {
    EXPECT_EQ(std::string(error.what()), b.string() + ":1:7: the name 'x' is taken already at " + a.string() +
                                             ":1:7\n" + c.string() +
                                             ":4:7: seed: expected a number, found 'x'");
  }
  EXPECT_EQ(ReadScenarios({a}, options_).size(), 1U);
  EXPECT_TRUE(ReadScenarios({}, options_).empty());
}

}  // namespace
}  // namespace tiltproof::harness
