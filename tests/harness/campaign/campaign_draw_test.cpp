#include "harness/campaign/campaign_draw.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "faults/registry.h"
#include "faults/signal_choice.h"
#include "harness/scenario/fault_support.h"
#include "harness/scenario/reader.h"
#include "plant/vehicle_model.h"

namespace tiltproof::harness {
namespace {

using ::testing::Each;
using ::testing::Not;
using ::testing::StartsWith;

const std::filesystem::path kSource = TILTPROOF_SOURCE_DIR;

std::shared_ptr<const plant::VehicleModel> Vehicle() {
  static const auto model = [] {
    std::vector<std::string> warnings;
    return std::make_shared<const plant::VehicleModel>(
        plant::LoadVehicle(kSource / "plant/models/tiltrotor.sdf", {}, warnings));
  }();
  return model;
}

ReadOptions Options() {
  ReadOptions options;
  options.models_folder = kSource / "plant/models";
  options.vehicle_signals = [](const Scenario&) { return std::optional(Vehicle()->signals()); };
  return options;
}

Scenario Base() {
  return ParseScenario(R"yaml(name: base
duration_s: 30
reference: {type: hover, at_m: [0, 0, 2]}
criteria:
  - {name: near, stl: "always(position_error_m <= 1)"}
)yaml",
                       "base.yaml", Options());
}

// Every type at every place where it can act in the flight with the firmware as a library.
std::vector<EnvelopeRow> Rows(const Scenario& base) {
  Scenario with_placeholder = base;
  faults::FaultSpec placeholder;
  placeholder.id = "draw-1";
  placeholder.type = kPlaceholderType;
  placeholder.start_ns = 0;
  placeholder.end_ns = base.duration_ns;
  with_placeholder.faults = {placeholder};
  const ClientAbilities abilities = AbilitiesOf(HostLibrary{}, false);
  std::vector<EnvelopeRow> rows;
  for (const faults::FaultType& type : faults::FaultTypes()) {
    for (const EnvelopeRow& row : RowsAtEveryPlace(type, base, Vehicle()->signals())) {
      const faults::FaultSpec fault = WithRow(with_placeholder, row, Vehicle()->signals()).faults.front();
      if (!faults::ProtocolProblem(fault, base.protocol_of(fault)) && !Unsupported(fault, type, abilities) &&
          !faults::Unsuited(fault, type, Vehicle()->signals()))
        rows.push_back(row);
    }
  }
  return rows;
}

CampaignPlan Plan(const DrawSpec& draw = {}, const Scenario& scenario = Base()) {
  CampaignPlan plan;
  plan.spec.draw = draw;
  DrawBase base;
  base.scenario = scenario;
  base.model = Vehicle();
  base.types = PrepareTypes(draw, base.scenario, Vehicle()->signals(), Rows(base.scenario));
  plan.bases = {base};
  return plan;
}

// True if `count` of `all` is what a share of this size gives, to within five standard deviations.
bool IsShare(double count, double all, double share) {
  return std::abs(count - all * share) <= 5 * std::sqrt(all * share * (1 - share)) + 1e-9;
}

TEST(CampaignDraw, RunsAreTheSameInAnyOrder) {
  const CampaignPlan plan = Plan();
  std::vector<std::string> forward;
  for (std::uint64_t number = 0; number < 50; ++number)
    forward.push_back(WriteResolved(DrawRun(plan, number).scenario));
  const CampaignPlan again = Plan();
  for (std::uint64_t number = 50; number-- > 0;)
    EXPECT_EQ(WriteResolved(DrawRun(again, number).scenario), forward[number]);
  EXPECT_EQ(std::set<std::string>(forward.begin(), forward.end()).size(), forward.size());
  CampaignPlan other = Plan();
  other.spec.seed = 2;
  EXPECT_NE(WriteResolved(DrawRun(other, 0).scenario), forward[0]);
}

// The reader is the reference: it checks all that a scenario of a user is checked for.
TEST(CampaignDraw, EveryRunIsAValidScenario) {
  const CampaignPlan plan = Plan({.faults_count_min = 1, .faults_count_max = 6});
  std::map<std::string, std::set<std::string>> places;
  for (std::uint64_t number = 0; number < 600; ++number) {
    const DrawnRun run = DrawRun(plan, number);
    const std::string text = WriteResolved(run.scenario);
    try {
      EXPECT_EQ(WriteResolved(ParseScenario(text, "drawn.yaml", Options())), text);
    } catch (const std::exception& error) {
      FAIL() << "run " << number << ": " << error.what() << "\n" << text;
    }
    ASSERT_EQ(run.faults.size(), run.scenario.faults.size());
    for (const CampaignFault& fault : run.faults) {
      places[fault.type].insert(fault.place);
      EXPECT_LE(fault.end_s, 30);
      EXPECT_LT(fault.start_s, fault.end_s) << fault.type;
    }
  }
  EXPECT_EQ(places.size(), plan.bases.front().types.size()) << "some type was never drawn";
  EXPECT_GT(places.at("sensor.bias").size(), 10U);
}

// Two boards with two lines between them; frames are known on one.
Scenario TwoBoards() {
  return ParseScenario(R"yaml(name: two-boards
duration_s: 30
reference: {type: hover, at_m: [0, 0, 2]}
clients: [{id: a}, {id: b}]
lines:
  - {id: cross, between: [a, b], protocol: paper}
  - {id: raw, between: [b, a]}
arbiter: {type: primary_backup, timeout_ms: 36}
faults:
  - {id: both-drift, type: clock.drift, start_s: 0, end_s: 30, parameters: {node: client, ppm: 100}}
criteria:
  - {name: near, stl: "always(position_error_m <= 1)"}
)yaml",
                       "two-boards.yaml", Options());
}

TEST(CampaignDraw, FaultsActOnEachClientAndEachLineBetweenThem) {
  const CampaignPlan plan = Plan({.faults_count_min = 1, .faults_count_max = 6}, TwoBoards());
  std::map<std::string, std::set<std::string>> places;
  for (std::uint64_t number = 0; number < 3000; ++number) {
    const DrawnRun run = DrawRun(plan, number);
    const std::string text = WriteResolved(run.scenario);
    ASSERT_NO_THROW(EXPECT_EQ(WriteResolved(ParseScenario(text, "drawn.yaml", Options())), text)) << text;
    for (const CampaignFault& fault : run.faults) places[fault.type].insert(fault.place);
  }
  const std::set<std::string> lines = {"cross", "cross_to_a", "cross_to_b", "raw", "raw_to_a", "raw_to_b"};
  std::set<std::string> expected = lines;
  for (const char* client : {"a", "b"})
    for (const char* target : {"to_plant", "to_client", "both", "reference"})
      expected.insert(std::string(client) + ":" + target);
  EXPECT_EQ(places.at("wire.bit_error"), expected);
  EXPECT_THAT(places.at("frame.drop"), ::testing::IsSupersetOf({"cross", "cross_to_a", "a:to_plant"}));
  EXPECT_THAT(places.at("frame.drop"), Each(Not(StartsWith("raw"))));
  EXPECT_EQ(places.at("device.reset"), (std::set<std::string>{"a", "b"}));
  EXPECT_THAT(places.at("sensor.bias"), ::testing::IsSupersetOf({"a:z_m", "b:z_m"}));
  EXPECT_THAT(places.at("actuator.lag"), ::testing::Contains("f_r")) << "the vehicle has one of each";
}

TEST(CampaignDraw, LeavesOutFaultsThatChangeNothing) {
  std::vector<std::string> names;
  const CampaignPlan plan = Plan();
  for (const DrawType& type : plan.bases.front().types) names.emplace_back(type.type->name);
  EXPECT_THAT(names, Each(Not(StartsWith("harness."))));
  EXPECT_THAT(names, Not(::testing::Contains("frame.script")));
  EXPECT_THAT(names, Not(::testing::Contains("node.kill"))) << "a client in lockstep has no node";
  EXPECT_GT(names.size(), 60U);
}

TEST(CampaignDraw, CountsAndTypesAreUniformWithoutSwarm) {
  const CampaignPlan plan =
      Plan({.types = {"wire.*"}, .swarm = false, .faults_count_min = 1, .faults_count_max = 4});
  const double types = static_cast<double>(plan.bases.front().types.size());
  std::map<std::size_t, int> counts;
  std::map<std::string, int> drawn;
  double all = 0;
  constexpr int kRuns = 4000;
  for (std::uint64_t number = 0; number < kRuns; ++number) {
    const DrawnRun run = DrawRun(plan, number);
    ++counts[run.faults.size()];
    for (const CampaignFault& fault : run.faults) ++drawn[fault.type];
    all += static_cast<double>(run.faults.size());
  }
  for (std::size_t count = 1; count <= 4; ++count)
    EXPECT_TRUE(IsShare(counts[count], kRuns, 0.25)) << count << " faults: " << counts[count];
  EXPECT_EQ(drawn.size(), plan.bases.front().types.size());
  for (const auto& [type, count] : drawn)
    EXPECT_TRUE(IsShare(count, all, 1 / types)) << type << ": " << count << " of " << all;
}

// A subset has s of n types with probability log((s + 1) / s) / log(n + 1); two faults then agree with 1/s.
TEST(CampaignDraw, SwarmRepeatsTypesAsOftenAsItsSubsetsSay) {
  const auto same = [](bool swarm) {
    const CampaignPlan plan = Plan({.swarm = swarm, .faults_count_min = 2, .faults_count_max = 2});
    int count = 0;
    for (std::uint64_t number = 0; number < 3000; ++number) {
      const DrawnRun run = DrawRun(plan, number);
      // Two drifts of a clock do not go together: such a run has one.
      count += run.faults.size() < 2 || run.faults[0].type == run.faults[1].type ? 1 : 0;
    }
    return std::pair(count, static_cast<double>(plan.bases.front().types.size()));
  };
  const auto [with, types] = same(true);
  double expected = 0;
  for (double s = 1; s <= types; ++s) expected += std::log((s + 1) / s) / std::log(types + 1) / s;
  EXPECT_NEAR(with / 3000.0, expected, 5 * std::sqrt(expected * (1 - expected) / 3000) + 0.01);
  const auto [without, same_types] = same(false);
  EXPECT_LT(without, 3000 * 3 / same_types);
}

TEST(CampaignDraw, LevelsGoFromMildToSevere) {
  const CampaignPlan plan = Plan();
  for (const DrawType& type : plan.bases.front().types) {
    for (const DrawPlace& place : type.places) {
      if (!place.severity) continue;
      const LevelRange& range = place.severity->range;
      const double sign = range.end > range.start ? 1 : -1;
      double before = LevelAt(range, 0);
      for (double share = 0.125; share <= 1; share += 0.125) {
        const double level = LevelAt(range, share);
        EXPECT_GE((level - before) * sign, 0) << type.type->name << " " << place.name << " " << share;
        before = level;
      }
      EXPECT_GT((before - LevelAt(range, 0)) * sign, 0) << type.type->name;
    }
  }
}

TEST(CampaignDraw, LevelsAreSpacedByTheirScale) {
  using faults::Scale;
  EXPECT_DOUBLE_EQ(LevelAt({.start = 0, .end = 8, .typical = 2}, 0.25), 2);
  EXPECT_DOUBLE_EQ(LevelAt({.start = 1, .end = 0, .scale = Scale::kLinear, .typical = 0.5}, 0.5), 0.5);
  // Two decades to both sides of what is typical.
  EXPECT_NEAR(LevelAt({.start = 0, .end = 1e6, .typical = 3}, 0), 0.03, 1e-9);
  EXPECT_NEAR(LevelAt({.start = 0, .end = 1e6, .typical = 3}, 0.5), 3, 1e-9);
  EXPECT_NEAR(LevelAt({.start = 0, .end = 1e6, .typical = 3}, 1), 300, 1e-9);
  EXPECT_NEAR(LevelAt({.start = 0, .end = -1e6, .typical = -3}, 0.5), -3, 1e-9);
  EXPECT_NEAR(LevelAt({.start = 0, .end = 1, .scale = Scale::kLogarithmic, .typical = 0.1}, 0), 1e-3, 1e-12);
  EXPECT_NEAR(LevelAt({.start = 0, .end = 1, .scale = Scale::kLogarithmic, .typical = 0.1}, 1), 1, 1e-12);
  EXPECT_NEAR(LevelAt({.start = 1e6, .end = 1e3, .scale = Scale::kLogarithmic}, 1.0 / 3), 1e5, 1e-6);
  EXPECT_EQ(LevelAt({.start = 0, .end = 10, .whole = true}, 0.26), 3);
}

TEST(CampaignDraw, SeveritiesHaveTheirDistribution) {
  const CampaignPlan plan = Plan({.types = {"wire.bit_error"}, .faults_count_max = 1});
  const LevelRange& range = plan.bases.front().types.front().places.front().severity->range;
  const double least = std::log(LevelAt(range, 0)), greatest = std::log(LevelAt(range, 1));
  std::map<int, int> tenths;
  constexpr int kRuns = 3000;
  for (std::uint64_t number = 0; number < kRuns; ++number) {
    const double level = DrawRun(plan, number).faults.at(0).severity;
    ++tenths[std::min(9, static_cast<int>(10 * (std::log(level) - least) / (greatest - least) + 1e-9))];
  }
  for (int tenth = 0; tenth < 10; ++tenth)
    EXPECT_TRUE(IsShare(tenths[tenth], kRuns, 0.1)) << tenth << ": " << tenths[tenth];
}

TEST(CampaignDraw, WindowsAndParametersAreAsTheFileSays) {
  DrawSpec draw;
  draw.types = {"frame.delay"};
  draw.faults_count_max = 1;
  draw.parameters["frame.delay"]["mean_ms"] = {Distribution::Kind::kUniform, {5.0, 7.0}};
  draw.parameters["frame.delay"]["distribution"] = {Distribution::Kind::kChoice,
                                                    {std::string("constant"), std::string("normal")}};
  draw.start_s = {Distribution::Kind::kUniform, {10.0, 20.0}};
  draw.length_s = {Distribution::Kind::kChoice, {0.5, 2.0}};
  const CampaignPlan plan = Plan(draw);
  std::map<std::string, int> words;
  std::map<double, int> lengths;
  double sum_ms = 0, sum_s = 0;
  constexpr int kRuns = 2000;
  for (std::uint64_t number = 0; number < kRuns; ++number) {
    const DrawnRun run = DrawRun(plan, number);
    const CampaignFault& fault = run.faults.at(0);
    EXPECT_GE(fault.severity, 5);
    EXPECT_LE(fault.severity, 7);
    EXPECT_GE(fault.start_s, 9.999);
    EXPECT_LE(fault.start_s, 20);
    ++lengths[std::round(1000 * (fault.end_s - fault.start_s)) / 1000];
    ++words[std::get<std::string>(run.scenario.faults.at(0).parameters.at("distribution"))];
    sum_ms += fault.severity;
    sum_s += fault.start_s;
  }
  EXPECT_NEAR(sum_ms / kRuns, 6, 5 * 2 / std::sqrt(12.0 * kRuns));
  EXPECT_NEAR(sum_s / kRuns, 15, 5 * 10 / std::sqrt(12.0 * kRuns));
  EXPECT_EQ(lengths.size(), 2U);
  EXPECT_TRUE(IsShare(lengths[0.5], kRuns, 0.5)) << lengths[0.5];
  EXPECT_EQ(words.size(), 2U);
  EXPECT_TRUE(IsShare(words["normal"], kRuns, 0.5)) << words["normal"];
}

TEST(CampaignDraw, FaultsEndBeforeTheTimeToRecover) {
  const CampaignPlan plan = Plan({.recover_s = 12});
  for (std::uint64_t number = 0; number < 400; ++number) {
    for (const CampaignFault& fault : DrawRun(plan, number).faults) {
      EXPECT_LE(fault.end_s, 18) << fault.type << " of run " << number;
    }
  }
}

TEST(CampaignDraw, RecoveryJudgesTheEnd) {
  const auto rewritten = [](const std::string& formula) {
    Scenario scenario;
    scenario.duration_ns = 30 * kNsPerS;
    scenario.criteria = {{.name = "one", .stl = formula, .metric = {}, .min = {}, .max = {}}};
    return WithRecovery(scenario, 8).criteria.front().stl;
  };
  EXPECT_EQ(rewritten("always(abs(roll_rad) <= 0.6)"), "always[28,30](abs(roll_rad) <= 0.6)");
  EXPECT_EQ(rewritten(" always [5, 60] ( x_m <= 1 )"), "always[28,30](x_m <= 1)");
  // A word that only looks like a time operator, and brackets within.
  EXPECT_EQ(rewritten("always(((x_until_m) <= 1 and (y_m <= 1)))"),
            "always[28,30]((x_until_m <= 1 and y_m <= 1))");
  EXPECT_EQ(rewritten("always(fault_active(\"always\") implies x_m <= 1)"),
            "always[28,30]((fault_active(\"always\") implies x_m <= 1))");
  for (const char* kept : {"eventually(x_m <= 1)", "always(x_m <= 1) and always(y_m <= 1)",
                           "always(x_m <= 1 or eventually[0,2](y_m <= 1))", "x_m <= 1"})
    EXPECT_EQ(rewritten(kept), kept);
}

TEST(CampaignDraw, BuildsFlyTheSameDraws) {
  CampaignPlan plan = Plan();
  plan.spec.firmware = {"paper", "tolerant"};
  for (std::uint64_t draw = 0; draw < 20; ++draw) {
    const DrawnRun paper = DrawRun(plan, 2 * draw), tolerant = DrawRun(plan, 2 * draw + 1);
    EXPECT_EQ(paper.scenario.firmware, "paper");
    EXPECT_EQ(tolerant.scenario.firmware, "tolerant");
    EXPECT_EQ(paper.faults, tolerant.faults);
    EXPECT_EQ(paper.scenario.seed, tolerant.scenario.seed);
  }
  // A campaign with one build has the same draws, too.
  CampaignPlan one = Plan();
  EXPECT_EQ(DrawRun(one, 7).faults, DrawRun(plan, 14).faults);
}

}  // namespace
}  // namespace tiltproof::harness
