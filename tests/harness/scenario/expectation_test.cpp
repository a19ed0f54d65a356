// `expect`: one verdict, or one for each build of the firmware, and which of them counts.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "harness/scenario/reader.h"

namespace tiltproof::harness {
namespace {

using testing::ElementsAre;
using testing::Pair;

class ExpectationTest : public testing::Test {
 protected:
  ExpectationTest() {
    options_.models_folder = std::string(TILTPROOF_SOURCE_DIR) + "/plant/models";
    options_.firmware_names = {"paper", "paper_published", "tolerant"};
  }

  Scenario With(const std::string& more) {
    return ParseScenario("name: x\nduration_s: 24\nreference: {type: hover, at_m: [0, 0, 2]}\n" + more,
                         "x.yaml", options_);
  }

  std::vector<std::string> ErrorsWith(const std::string& more) {
    std::vector<std::string> texts;
    try {
      With(more);
    } catch (const ScenarioError& error) {
      for (const Diagnostic& diagnostic : error.diagnostics()) texts.push_back(ToString(diagnostic));
    }
    return texts;
  }

  ReadOptions options_;
};

TEST_F(ExpectationTest, OneVerdictIsForEveryBuild) {
  Scenario scenario = With("expect: fail\n");
  EXPECT_EQ(scenario.expected(), Verdict::kFail);
  scenario.FlyFirmware("tolerant");
  EXPECT_EQ(scenario.expected(), Verdict::kFail);
}

TEST_F(ExpectationTest, ABuildHasItsOwnAndOthersAreToPass) {
  Scenario scenario = With("expect: {paper: fail, tolerant: inconclusive}\n");
  EXPECT_THAT(scenario.expect.by_firmware,
              ElementsAre(Pair("paper", Verdict::kFail), Pair("tolerant", Verdict::kInconclusive)));
  EXPECT_EQ(scenario.expected(), Verdict::kFail);  // paper is the default
  scenario.FlyFirmware("tolerant");
  EXPECT_EQ(scenario.expected(), Verdict::kInconclusive);
  scenario.FlyFirmware("paper_published");
  EXPECT_EQ(scenario.expected(), Verdict::kPass);
}

TEST_F(ExpectationTest, OfSeveralClientsTheOneThatMovesTheVehicleDecides) {
  const std::string clients = "clients: [{id: a}, {id: b, firmware: tolerant}]\nexpect: {tolerant: fail}\n";
  EXPECT_EQ(With(clients).expected(), Verdict::kPass);
  Scenario scenario = With(clients + "arbiter: {client: b}\n");
  EXPECT_EQ(scenario.expected(), Verdict::kFail);
  scenario.FlyFirmware("paper");  // of every client
  EXPECT_EQ(scenario.firmware_of(1), "paper");
  EXPECT_EQ(scenario.expected(), Verdict::kPass);
}

TEST_F(ExpectationTest, MistakesHaveTheirPlace) {
  EXPECT_THAT(ErrorsWith("expect: {paper: fial}\n"),
              ElementsAre("x.yaml:4:17: expect: paper: unknown value 'fial'; did you mean 'fail'?"));
  EXPECT_THAT(ErrorsWith("expect: {papr: fail}\n"),
              ElementsAre("x.yaml:4:10: expect: unknown build 'papr'; did you mean 'paper'?"));
  EXPECT_THAT(ErrorsWith("expect: {paper: fail, paper: pass}\n").size(), 1);
  EXPECT_THAT(ErrorsWith("expect: {}\n"), ElementsAre("x.yaml:4:9: expect: the mapping is empty"));
  EXPECT_THAT(ErrorsWith("expect:\n  paper:\n"),
              ElementsAre("x.yaml:5:3: expect: paper: the value is missing"));
  EXPECT_THAT(
      ErrorsWith("expect: {paper: [fail]}\n"),
      ElementsAre("x.yaml:4:17: expect: paper: expected one of pass, fail, inconclusive, error, found a "
                  "list"));
  EXPECT_THAT(ErrorsWith("expect: {Paper: fail}\n"),
              ElementsAre("x.yaml:4:10: expect: 'Paper' must be lower-case letters, digits and '_'"));
}

TEST_F(ExpectationTest, WithAFirmwareOfTheUsersAnyBuildMayBeNamed) {
  options_.firmware_names.clear();
  EXPECT_EQ(With("firmware: mine_2\nexpect: {mine_2: fail, \"1\": error}\n").expected(), Verdict::kFail);
}

}  // namespace
}  // namespace tiltproof::harness
