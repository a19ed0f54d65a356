#include "harness/campaign/campaign_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <string>
#include <string_view>

#include "harness/scenario/diagnostic.h"

namespace tiltproof::harness {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr const char* kWhole = R"(campaign: night
scenarios: [hover.yaml, ../other/spiral.yaml]
runs_count: 10000
seed: 7
firmware: [paper, tolerant]
draw:
  types: ["wire.*", frame.delay, sensor.bias]
  swarm: false
  faults_count: {min: 2, max: 5}
  parameters:
    frame.delay: {mean_ms: {log_uniform: [1, 30]}, distribution: {choice: [constant, normal]}}
    sensor.bias: {offset: {uniform: [-0.5, 0.5]}}
  start_s: {uniform: [5, 20]}
  length_s: {choice: [0.5, 1, 2]}
  recover_s: 10
stop: {failures_count: 100, wall_s: 3600}
)";

std::string Mistake(const std::string& text) {
  try {
    ParseCampaign(text, "/c/night.yaml");
  } catch (const ScenarioError& error) {
    return error.what();
  }
  return "";
}

std::string With(const std::string& draw) {
  return "campaign: night\nscenarios: [a.yaml]\ndraw:\n  " + draw + "\n";
}

TEST(CampaignFile, HasEveryKey) {
  const CampaignSpec spec = ParseCampaign(kWhole, "/c/night.yaml");
  EXPECT_EQ(spec.name, "night");
  EXPECT_THAT(spec.scenarios, ElementsAre("/c/hover.yaml", "/other/spiral.yaml"));
  EXPECT_EQ(spec.runs_count, 10000);
  EXPECT_EQ(spec.seed, 7);
  EXPECT_THAT(spec.firmware, ElementsAre("paper", "tolerant"));
  EXPECT_THAT(spec.draw.types, ElementsAre("wire.*", "frame.delay", "sensor.bias"));
  EXPECT_FALSE(spec.draw.swarm);
  EXPECT_EQ(spec.draw.faults_count_min, 2);
  EXPECT_EQ(spec.draw.faults_count_max, 5);
  const Distribution& delay = spec.draw.parameters.at("frame.delay").at("mean_ms");
  EXPECT_EQ(delay.kind, Distribution::Kind::kLogUniform);
  EXPECT_THAT(delay.values, ElementsAre(NumberOrWord(1.0), NumberOrWord(30.0)));
  EXPECT_THAT(spec.draw.parameters.at("frame.delay").at("distribution").values,
              ElementsAre(NumberOrWord("constant"), NumberOrWord("normal")));
  EXPECT_EQ(spec.draw.start_s->kind, Distribution::Kind::kUniform);
  EXPECT_EQ(spec.draw.length_s->kind, Distribution::Kind::kChoice);
  EXPECT_EQ(spec.draw.recover_s, 10.0);
  EXPECT_EQ(spec.stop.failures_count, 100);
  EXPECT_EQ(spec.stop.wall_s, 3600.0);
}

TEST(CampaignFile, ReadsBackAsItIsWritten) {
  for (const std::string& text : {std::string(kWhole), std::string("campaign: a\nscenarios: [b.yaml]\n")}) {
    const CampaignSpec spec = ParseCampaign(text, "/c/night.yaml");
    EXPECT_EQ(ParseCampaign(WriteCampaign(spec), "/elsewhere/other.yaml"), spec) << WriteCampaign(spec);
  }
}

TEST(CampaignFile, NamesThePlaceOfEachMistake) {
  EXPECT_THAT(Mistake("campaign: a\n"), HasSubstr("/c/night.yaml:1:1: missing key 'scenarios'"));
  EXPECT_THAT(Mistake("campaign: a\nscenarios: []\n"), HasSubstr(":2:12: scenarios: the list is empty"));
  EXPECT_THAT(Mistake("campaign: a\nscenarios: [b]\nruns: 5\n"), HasSubstr(":3:1: unknown key 'runs'"));
  EXPECT_THAT(Mistake("campaign: a\nscenarios: [b]\nfirmware: [paper, paper]\n"),
              HasSubstr(":3:19: firmware: paper is named twice"));
  EXPECT_THAT(Mistake(With("types: [frame.dealy]")),
              HasSubstr(":4:11: types: 'frame.dealy' matches no fault type; did you mean 'frame.delay'?"));
  EXPECT_THAT(Mistake(With("faults_count: {min: 4, max: 2}")), HasSubstr(":4:23: min: 4 is above max, 2"));
  EXPECT_THAT(Mistake(With("parameters: {frame.dely: {mean_ms: {uniform: [1, 2]}}}")),
              HasSubstr("unknown key 'frame.dely'; did you mean 'frame.delay'?"));
  EXPECT_THAT(Mistake(With("parameters: {frame.delay: {mean: {uniform: [1, 2]}}}")),
              HasSubstr("unknown key 'mean'; did you mean 'mean_ms'?"));
  EXPECT_THAT(Mistake(With("types: [wire.*]\n  parameters: {frame.delay: {mean_ms: {uniform: [1, 2]}}}")),
              HasSubstr(":5:16: parameters: frame.delay is not among `types`"));
}

TEST(CampaignFile, BuildsAreThoseOfTheClient) {
  const std::array<std::string_view, 2> builds = {"paper", "tolerant"};
  const std::string text = "campaign: a\nscenarios: [b]\nfirmware: [paper, tolerent]\n";
  EXPECT_THAT([&] { ParseCampaign(text, "/c/night.yaml", builds); },
              ::testing::ThrowsMessage<ScenarioError>(HasSubstr(
                  "/c/night.yaml:3:19: firmware: unknown build 'tolerent'; did you mean 'tolerant'?")));
  EXPECT_THAT(ParseCampaign(text, "/c/night.yaml").firmware, ElementsAre("paper", "tolerent"));
}

TEST(CampaignFile, ChecksDistributions) {
  const auto delay = [](const std::string& distribution) {
    return Mistake(With("parameters: {frame.delay: {mean_ms: " + distribution + "}}"));
  };
  EXPECT_THAT(delay("{uniform: [1]}"), HasSubstr(":4:39: mean_ms: uniform needs two numbers"));
  EXPECT_THAT(delay("{uniform: [3, 1]}"), HasSubstr("3 is above 1"));
  EXPECT_THAT(delay("{log_uniform: [0, 1]}"), HasSubstr("log_uniform needs two numbers above 0"));
  EXPECT_THAT(delay("{uniform: [1, 1e9]}"), HasSubstr("is out of range; must be from 0 to"));
  EXPECT_THAT(delay("{choice: [fast]}"), HasSubstr("mean_ms: expected numbers, found 'fast'"));
  EXPECT_THAT(delay("{uniform: [1, 2], choice: [1]}"), HasSubstr("not both"));
  EXPECT_THAT(delay("{}"), HasSubstr("a distribution needs 'uniform' or 'log_uniform' or 'choice'"));
  EXPECT_THAT(Mistake(With("parameters: {frame.delay: {distribution: {uniform: [1, 2]}}}")),
              HasSubstr("distribution: is a word: draw it by `choice`"));
  EXPECT_THAT(Mistake(With("parameters: {frame.delay: {distribution: {choice: [normale]}}}")),
              HasSubstr("unknown value 'normale'; did you mean 'normal'?"));
  EXPECT_THAT(Mistake(With("start_s: {uniform: [-1, 5]}")), HasSubstr("start_s: expected seconds from 0 to"));
}

}  // namespace
}  // namespace tiltproof::harness
