// The search for the smallest failure against schedules that are planted without a flight.
#include "harness/campaign/smallest_failure.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "faults/random.h"
#include "harness/scenario/reader.h"
#include "tests/harness/campaign/tilt_rotor.h"

namespace tiltproof::harness {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr double kViolated_s = 30;

faults::FaultSpec Fault(const std::string& id, const std::string& type = "harness.null") {
  faults::FaultSpec fault;
  fault.id = id;
  fault.type = type;
  if (type == "harness.null") fault.target = faults::Target::kToClient;
  fault.start_ns = 10 * kNsPerS;
  fault.end_ns = 40 * kNsPerS;
  return fault;
}

Scenario WithFaults(std::size_t count) {
  Scenario scenario;
  scenario.name = "planted";
  scenario.duration_ns = 60 * kNsPerS;
  scenario.criteria = {
      {.name = "near", .stl = "always(position_error_m <= 1)", .metric = {}, .min = {}, .max = {}},
      {.name = "upright", .stl = "always(tilt_rad <= 0.6)", .metric = {}, .min = {}, .max = {}}};
  for (std::size_t i = 0; i < count; ++i) scenario.faults.push_back(Fault("f" + std::to_string(i)));
  return scenario;
}

std::set<std::string> IdsOf(const Scenario& scenario) {
  std::set<std::string> ids;
  for (const auto& fault : scenario.faults) ids.insert(fault.id);
  return ids;
}

Flown Result(const Scenario& scenario, bool fails) {
  Flown flown{.criterion = fails ? "near" : "", .time_s = kViolated_s, .activations = {}};
  flown.activations.assign(scenario.faults.size(), 1);
  return flown;
}

struct Planted {
  Scenario scenario;
  std::function<bool(const Scenario&)> fails;
  std::size_t flights = 0;

  Evaluate evaluate() {
    return [this](const Scenario& flown) {
      ++flights;
      return Result(flown, fails(flown));
    };
  }
  SmallestFailure Faults(std::size_t runs_max = 1000) {
    return MinimiseFaults(scenario, evaluate(), {.runs_max = runs_max});
  }
  SmallestFailure All(std::size_t runs_max = 1000) {
    return MinimiseFailure(scenario, TiltRotorSignals(), evaluate(), {.runs_max = runs_max});
  }
};

std::function<bool(const Scenario&)> Needs(const std::set<std::string>& causes) {
  return [causes](const Scenario& scenario) {
    const std::set<std::string> ids = IdsOf(scenario);
    return std::includes(ids.begin(), ids.end(), causes.begin(), causes.end());
  };
}

std::set<std::string> Draw(faults::Random& random, std::size_t among, std::size_t count) {
  std::set<std::string> drawn;
  while (drawn.size() < count) drawn.insert("f" + std::to_string(random.Below(among)));
  return drawn;
}

// Every single cause, and every pair, among 12. For the worst of each, delta (Debian, 2006) with a shell script flies 45 and
// 53.
TEST(MinimiseFaults, FliesLessThanDeltaForEachCauseAmongTwelve) {
  for (int a = 0; a < 12; ++a) {
    for (int b = a; b < 12; ++b) {
      const std::set<std::string> causes = {"f" + std::to_string(a), "f" + std::to_string(b)};
      Planted planted{WithFaults(12), Needs(causes)};
      const SmallestFailure found = planted.Faults();
      EXPECT_EQ(IdsOf(found.scenario), causes);
      EXPECT_TRUE(found.confirmed);
      EXPECT_EQ(found.runs, planted.flights);
      EXPECT_LE(found.runs, a == b ? 12u : 18u);
    }
  }
}

TEST(MinimiseFaults, TwoAmongFortyTakeAtMostThirtyFlights) {
  faults::Random random(3);
  for (int trial = 0; trial < 100; ++trial) {
    const std::set<std::string> causes = Draw(random, 40, 2);
    Planted planted{WithFaults(40), Needs(causes)};
    const SmallestFailure found = planted.Faults();
    EXPECT_EQ(IdsOf(found.scenario), causes);
    EXPECT_LE(found.runs, 30u);
  }
}

// One to five faults that only fail together, among 2 to 60, each with a window of its own; some never act.
TEST(MinimiseFaults, FindsWhatWasPlanted) {
  faults::Random random(4);
  for (int trial = 0; trial < 200; ++trial) {
    const std::size_t count = 5 + random.Below(56);
    const std::set<std::string> causes = Draw(random, count, 1 + random.Below(5));
    Planted planted{WithFaults(count), Needs(causes)};
    for (auto& fault : planted.scenario.faults) {
      fault.start_ns = FromSeconds(kViolated_s * random.Uniform());
      fault.end_ns =
          random.Below(3) == 0 ? kNever : fault.start_ns + FromSeconds(0.1 + 10 * random.Uniform());
      if (!causes.contains(fault.id) && random.Below(4) == 0) fault.start_ns = 50 * kNsPerS;
    }
    EXPECT_EQ(IdsOf(planted.Faults().scenario), causes) << trial;
  }
}

// Any of several sets fails, and some faults mask others: the result fails, and no fault alone can be left out of it.
TEST(MinimiseFaults, NoFaultCanBeLeftOutWhateverThePredicate) {
  faults::Random random(5);
  for (int trial = 0; trial < 200; ++trial) {
    const std::size_t count = 3 + random.Below(20);
    std::vector<std::pair<std::set<std::string>, std::set<std::string>>> sets;  // needed, and one that masks
    for (int i = 0; i < 3; ++i)
      sets.emplace_back(Draw(random, count, 1 + random.Below(3)), Draw(random, count, 1));
    const auto fails = [&](const Scenario& scenario) {
      const std::set<std::string> ids = IdsOf(scenario);
      return ids.size() == count || std::ranges::any_of(sets, [&](const auto& set) {
               return std::includes(ids.begin(), ids.end(), set.first.begin(), set.first.end()) &&
                      !ids.contains(*set.second.begin());
             });
    };
    Planted planted{WithFaults(count), fails};
    const SmallestFailure found = planted.Faults();
    EXPECT_TRUE(found.confirmed);
    EXPECT_TRUE(fails(found.scenario));
    for (std::size_t i = 0; i < found.scenario.faults.size(); ++i) {
      Scenario without = found.scenario;
      without.faults.erase(without.faults.begin() + static_cast<std::ptrdiff_t>(i));
      EXPECT_FALSE(fails(without)) << trial;
    }
  }
}

// The next question is one of the first two, whatever the answer.
TEST(Foreseen, HasTheNextQuestionWhateverTheAnswer) {
  faults::Random random(6);
  Planted planted{WithFaults(20), Needs(Draw(random, 20, 2))};
  const FailureSearch search = [&](const Evaluate& evaluate) {
    return MinimiseFailure(planted.scenario, TiltRotorSignals(), evaluate, {});
  };
  std::vector<Flown> answers;
  std::vector<std::string> foreseen;  // while the question before was open
  std::size_t count = 0;
  search([&](const Scenario& question) -> std::optional<Flown> {
    if (answers.size() > 1) {
      EXPECT_THAT(foreseen, Contains(WriteResolved(question))) << answers.size();
      ++count;
    }
    foreseen.clear();
    for (const Scenario& next : Foreseen(search, answers, 2)) foreseen.push_back(WriteResolved(next));
    EXPECT_LE(foreseen.size(), 2u);
    answers.push_back(Result(question, planted.fails(question)));
    return answers.back();
  });
  EXPECT_GT(count, 20u);
}

TEST(MinimiseFaults, OneFlightProvesWhichCannotMatter) {
  Planted planted{WithFaults(200), Needs({"f199"})};
  const Evaluate only_last_acts = [&](const Scenario& scenario) {
    Flown flown = Result(scenario, planted.fails(scenario));
    for (std::size_t i = 0; i < scenario.faults.size(); ++i)
      flown.activations[i] = scenario.faults[i].id == "f199" ? 1 : 0;
    return flown;
  };
  const SmallestFailure found = MinimiseFaults(planted.scenario, only_last_acts, {.runs_max = 100});
  EXPECT_EQ(IdsOf(found.scenario), std::set<std::string>{"f199"});
  EXPECT_EQ(found.runs, 4u);  // as given, without any fault, without the idle ones, once more
}

TEST(MinimiseFaults, NoneIsLeftWhereNoneIsNeeded) {
  Planted planted{WithFaults(40), [](const Scenario&) { return true; }};
  const SmallestFailure found = planted.Faults();
  EXPECT_THAT(found.scenario.faults, IsEmpty());
  EXPECT_EQ(found.runs, 3u);
}

TEST(MinimiseFaults, WhoWaitsForAFaultGoesWithIt) {
  Planted planted{WithFaults(6), Needs({"f4"})};
  planted.scenario.faults[4].after = faults::After{.fault = "f2"};
  planted.scenario.faults[5].after = faults::After{.fault = "f4"};
  EXPECT_EQ(IdsOf(planted.Faults().scenario), (std::set<std::string>{"f2", "f4"}));
}

TEST(MinimiseFaults, AFaultThatTheCriterionNamesStays) {
  Planted planted{WithFaults(6), Needs({"f4"})};
  planted.scenario.criteria[0].stl = "always(fault_active(\"f1\") implies position_error_m <= 1)";
  const Scenario found = planted.Faults().scenario;
  EXPECT_EQ(IdsOf(found), (std::set<std::string>{"f1", "f4"}));
  ASSERT_EQ(found.criteria.size(), 1u);
  EXPECT_EQ(found.criteria[0].name, "near");
}

TEST(MinimiseFaults, AnotherCriterionIsAnotherFailure) {
  Planted planted{WithFaults(8), Needs({"f1", "f2"})};
  const Evaluate other = [&](const Scenario& scenario) {
    Flown flown = Result(scenario, planted.fails(scenario));
    if (flown.criterion.empty() && IdsOf(scenario).contains("f1")) flown.criterion = "survival";
    return flown;
  };
  const SmallestFailure found = MinimiseFaults(planted.scenario, other, {.runs_max = 100});
  EXPECT_EQ(IdsOf(found.scenario), (std::set<std::string>{"f1", "f2"}));
  EXPECT_EQ(found.last.criterion, "near");
}

TEST(MinimiseFaults, NothingToDoWhereNothingFails) {
  Planted planted{WithFaults(8), [](const Scenario&) { return false; }};
  const SmallestFailure found = planted.Faults();
  EXPECT_FALSE(found.fails());
  EXPECT_EQ(found.runs, 1u);
}

// However few flights there are, or whenever it is interrupted, the result is one that failed.
TEST(MinimiseFailure, NeverReturnsWhatDoesNotFail) {
  for (std::size_t runs_max = 2; runs_max < 60; ++runs_max) {
    Planted planted{WithFaults(20), Needs({"f3", "f17"})};
    const SmallestFailure found = planted.All(runs_max);
    EXPECT_LE(planted.flights, runs_max);
    EXPECT_TRUE(planted.fails(found.scenario));
    EXPECT_TRUE(found.confirmed);
    EXPECT_EQ(found.last.criterion, "near");

    std::size_t flights = 0;
    const Evaluate interrupted = [&](const Scenario& scenario) -> std::optional<Flown> {
      if (++flights == runs_max) return std::nullopt;
      return Result(scenario, planted.fails(scenario));
    };
    const SmallestFailure cut = MinimiseFailure(planted.scenario, TiltRotorSignals(), interrupted, {});
    EXPECT_TRUE(planted.fails(cut.scenario));
    EXPECT_EQ(flights, std::min(flights, runs_max)) << "nothing is flown after an interrupt";
  }
}

TEST(MinimiseFailure, WindowsToOneControlPeriod) {
  faults::Random random(6);
  for (int trial = 0; trial < 50; ++trial) {
    const TimeNs from = FromSeconds(10 + 10 * random.Uniform()),
                 to = from + FromSeconds(5 * random.Uniform());
    Planted planted{WithFaults(1), [&](const Scenario& scenario) {
                      return !scenario.faults.empty() && scenario.faults[0].start_ns <= from &&
                             scenario.faults[0].end_ns >= to;
                    }};
    if (trial % 2 == 0) planted.scenario.faults[0].end_ns = kNever;
    if (trial % 3 == 0) planted.scenario.faults[0].start_ns = kPowerOn;
    const SmallestFailure found = planted.All();
    const TimeNs period = planted.scenario.link.protocol->control_period_ns;
    EXPECT_GT(found.scenario.faults[0].start_ns + period, from);
    EXPECT_LT(found.scenario.faults[0].end_ns - period, to);
    EXPECT_TRUE(planted.fails(found.scenario));
    EXPECT_LE(found.runs, 45u);
  }
}

struct Level {
  std::string type, parameter;
  std::map<std::string, faults::ParameterValue> parameters;
  double own, limit, harmless;
};

TEST(MinimiseFailure, SeveritiesToOnePercentOfTheirLimit) {
  const std::vector<Level> levels = {
      {"sensor.bias", "offset", {{"signal", "z_m"}}, 5, 0.0371, 0},
      {"sensor.bias", "offset", {{"signal", "z_m"}}, -5, -0.371, 0},
      {"wire.bit_error", "ber", {}, 0.5, 3.3e-6, 0},
      {"frame.delay", "mean_ms", {}, 100, 11.3, 0},
      {"actuator.loss_of_effectiveness", "factor", {{"actuator", "f_r"}}, 0.1, 0.83, 1}};
  for (const Level& level : levels) {
    Planted planted{WithFaults(0), [&](const Scenario& scenario) {
                      if (scenario.faults.empty()) return false;
                      const double now = std::get<double>(scenario.faults[0].parameters.at(level.parameter));
                      return std::abs(now - level.harmless) >= std::abs(level.limit - level.harmless);
                    }};
    planted.scenario.faults = {Fault("only", level.type)};
    if (level.type.starts_with("wire.") || level.type.starts_with("frame."))
      planted.scenario.faults[0].target = faults::Target::kToClient;
    planted.scenario.faults[0].parameters = level.parameters;
    planted.scenario.faults[0].parameters[level.parameter] = level.own;
    const SmallestFailure found = planted.All();
    const double now = std::get<double>(found.scenario.faults[0].parameters.at(level.parameter));
    EXPECT_TRUE(planted.fails(found.scenario));
    EXPECT_LE(std::abs(now - level.limit), 0.0102 * std::abs(level.limit - level.harmless))
        << level.type << " " << now;
    EXPECT_LE(found.runs, 60u) << level.type;
  }
}

TEST(MinimiseFailure, TheFlightEndsAfterTheViolation) {
  Planted planted{WithFaults(1),
                  [](const Scenario& scenario) { return scenario.duration_ns >= 30 * kNsPerS; }};
  const SmallestFailure found = planted.All();
  EXPECT_GE(found.scenario.duration_ns, 30 * kNsPerS);
  EXPECT_LE(found.scenario.duration_ns, 30 * kNsPerS + 2 * planted.scenario.link.protocol->control_period_ns);
}

TEST(MinimiseFailure, APathThatDoesNotMatterBecomesAHover) {
  for (const bool matters : {false, true}) {
    Planted planted{WithFaults(1), [&](const Scenario& scenario) {
                      return !matters || std::holds_alternative<SpiralReference>(scenario.reference.path);
                    }};
    planted.scenario.initial_position_m = {1, 2, 3};
    planted.scenario.reference.path = SpiralReference{};
    const SmallestFailure found = planted.All();
    EXPECT_EQ(std::holds_alternative<HoverReference>(found.scenario.reference.path), !matters);
    if (matters) continue;
    EXPECT_THAT(std::get<HoverReference>(found.scenario.reference.path).at_m, ElementsAre(1, 2, 3));
  }
}

TEST(MinimiseFailure, NoiseThatDoesNotMatterIsLeftOut) {
  for (const bool matters : {false, true})
    for (const bool exists : {false, true}) {
      Planted planted{WithFaults(1),
                      [&](const Scenario& scenario) { return !matters || scenario.sensor_noise; }};
      const SmallestFailure found = MinimiseFailure(planted.scenario, TiltRotorSignals(), planted.evaluate(),
                                                    {.has_sensor_noise = exists});
      EXPECT_EQ(found.scenario.sensor_noise, matters || !exists);
    }
}

// Forty faults, of which two are needed together, each with a window and a severity of its own.
TEST(MinimiseFailure, FortyFaultsInTwoHundredFlights) {
  faults::Random random(7);
  for (int trial = 0; trial < 20; ++trial) {
    Planted planted{WithFaults(40), {}};
    for (auto& fault : planted.scenario.faults) {
      fault.type = "sensor.bias";
      fault.target = faults::Target::kNone;
      fault.parameters = {{"signal", "z_m"}, {"offset", 1.0}};
    }
    const std::set<std::string> causes = Draw(random, 40, 2);
    const TimeNs from = FromSeconds(12 + 4 * random.Uniform()), to = from + FromSeconds(3 * random.Uniform());
    const double limit = 0.01 + 0.9 * random.Uniform();
    planted.fails = [&](const Scenario& scenario) {
      std::size_t acting = 0;
      for (const auto& fault : scenario.faults)
        if (causes.contains(fault.id) && fault.start_ns <= from && fault.end_ns >= to &&
            std::get<double>(fault.parameters.at("offset")) >= limit)
          ++acting;
      return acting == 2;
    };
    std::vector<MinimiseStep> steps;
    const SmallestFailure found = MinimiseFailure(
        planted.scenario, TiltRotorSignals(), planted.evaluate(),
        {.runs_max = 210, .on_step = [&](const MinimiseStep& step) { steps.push_back(step); }});
    EXPECT_EQ(IdsOf(found.scenario), causes);
    EXPECT_FALSE(found.out_of_runs);
    ASSERT_FALSE(steps.empty());
    EXPECT_EQ(steps[0].what, "faults");
    EXPECT_EQ(steps[0].before, "40");
    EXPECT_EQ(steps[0].after, "2");
    EXPECT_LE(steps[0].runs, 60u);
    EXPECT_LE(found.runs - steps[0].runs, 150u);
  }
}

}  // namespace
}  // namespace tiltproof::harness
