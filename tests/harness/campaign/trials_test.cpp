// Trials of real flights: what decides, what is not flown, and what is not known.
#include "harness/campaign/trials.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <future>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "faults/registry.h"
#include "harness/campaign/envelope_rows.h"
#include "harness/campaign/margins.h"
#include "harness/engine/trunk.h"

namespace tiltproof::harness {
namespace {

using ::testing::HasSubstr;
using Answer = TrialResult::Answer;

std::shared_ptr<const plant::VehicleModel> TiltRotor() {
  static const auto model = [] {
    std::vector<std::string> warnings;
    return std::make_shared<const plant::VehicleModel>(
        plant::LoadVehicle(std::string(TILTPROOF_SOURCE_DIR) + "/plant/models/tiltrotor.sdf", {}, warnings));
  }();
  return model;
}

// From 1 s on the vehicle's position along x reads too much.
FlightJob Biased(const std::string& name, double bias_m) {
  FlightJob job{.name = name, .scenario = {}, .model = TiltRotor(), .means = {}, .replay = {}};
  job.scenario.name = name;
  job.scenario.duration_ns = 3 * kNsPerS;
  job.scenario.seed = 10;
  job.scenario.initial_position_m = {2, 0, 0.5};
  job.scenario.criteria = {
      {.name = "near", .stl = "always(position_error_m <= 1)", .metric = {}, .min = {}, .max = {}}};
  faults::FaultSpec bias;
  bias.id = "bias";
  bias.type = "sensor.bias";
  bias.start_ns = kNsPerS;
  bias.parameters = {{"signal", "x_m"}, {"offset", bias_m}};
  job.scenario.faults = {bias};
  return job;
}

TrialResult Try(const FlightJob& job, int jobs_count = 1) {
  Trials trials({.jobs_count = jobs_count}, 3);
  std::optional<TrialResult> found;
  trials.Start(job, [&](const TrialResult& result) { found = result; });
  trials.Fly();
  return found.value();
}

// Replies are lost at random from 1 s on.
FlightJob Lossy(const std::string& name, double probability) {
  FlightJob job = Biased(name, 0);
  faults::FaultSpec& loss = job.scenario.faults[0];
  loss.type = "frame.drop";
  loss.target = faults::Target::kToClient;
  loss.parameters = {{"probability", probability}};
  return job;
}

TEST(Trials, EverySeedMustPass) {
  const TrialResult result = Try(Lossy("mild", 0.05));
  EXPECT_EQ(result.answer, Answer::kSurvived);
  EXPECT_EQ(result.flights_count, 3u);
}

// Nothing in its flight is drawn at random: other seeds give the same flight, as their hashes show.
TEST(Trials, AFlightWithoutRandomnessIsFlownOnce) {
  const FlightJob job = Biased("mild", 0.01);
  EXPECT_EQ(Try(job).flights_count, 1u);
  std::set<std::string> hashes;
  for (const bool draws : {false, true}) {
    Engine engine({.jobs_count = 1});
    for (std::uint64_t seed = 10; seed < 13; ++seed) {
      FlightJob seeded = draws ? Lossy("lossy", 0.05) : job;
      seeded.name += std::to_string(seed);
      seeded.scenario.seed = seed;
      auto flown = engine.Submit(seeded);
      while (!engine.idle()) engine.Poll();
      const FlightResult result = flown.get();
      EXPECT_EQ(result.is_of_any_seed, !draws);
      hashes.insert(result.trace_hash);
    }
    EXPECT_EQ(hashes.size(), draws ? 4u : 1u);
  }
}

TEST(Trials, OneThatFailsDecides) {
  for (const int jobs_count : {1, 3}) {
    const TrialResult result = Try(Biased("hard", 1.5), jobs_count);
    EXPECT_EQ(result.answer, Answer::kFailed);
    EXPECT_EQ(result.flights_count, 1u);
    EXPECT_EQ(result.seed, 10u);
    EXPECT_EQ(result.criterion, "near");
    EXPECT_GT(result.time_s.value(), 1.0);
  }
}

TEST(Trials, SeedsAfterOneThatFailsAreNotFlown) {
  Trials trials({.jobs_count = 1}, 100);
  trials.Start(Biased("hard", 5), [](const TrialResult&) {});
  trials.Fly();
  EXPECT_EQ(trials.flown_count(), 1u);
}

TEST(Trials, AFaultThatNeverActsIsSurvived) {
  FlightJob job = Biased("never", 5);
  job.scenario.faults[0].probability = 0.0;
  EXPECT_EQ(Try(job).answer, Answer::kSurvived);
}

TEST(Trials, WhatIsExpectedDoesNotMatter) {
  FlightJob job = Biased("mild", 0.01);
  job.scenario.expect.verdict = Verdict::kFail;
  EXPECT_EQ(Try(job).answer, Answer::kSurvived);
}

TEST(Trials, AnErrorIsNoFailure) {
  FlightJob job = Biased("killed", 5);
  job.recorder.begin = [](const Scenario&) { kill(getpid(), SIGKILL); };
  const TrialResult result = Try(job);
  EXPECT_EQ(result.answer, Answer::kUnknown);
  EXPECT_EQ(result.verdict, Verdict::kError);
  EXPECT_EQ(result.flight, "killed, seed 10");
  EXPECT_THAT(result.reason, HasSubstr("killed by signal 9"));
}

TEST(Trials, AnUndecidedCriterionIsNoFailure) {
  FlightJob job = Biased("undecided", 0.01);
  job.scenario.criteria[0].stl = "always[0,10](position_error_m <= 1)";
  const TrialResult result = Try(job);
  EXPECT_EQ(result.answer, Answer::kUnknown);
  EXPECT_EQ(result.verdict, Verdict::kInconclusive);
}

TEST(Trials, OneEndedMayStartAnother) {
  Trials trials({.jobs_count = 2}, 2);
  std::vector<Answer> answers;
  trials.Start(Biased("first", 0.01), [&](const TrialResult& first) {
    answers.push_back(first.answer);
    trials.Start(Biased("second", 5), [&](const TrialResult& second) { answers.push_back(second.answer); });
  });
  trials.Fly();
  EXPECT_THAT(answers, ::testing::ElementsAre(Answer::kSurvived, Answer::kFailed));
}

// A short flight with noise, in which the second fault waits for its type.
FlightJob Probed() {
  FlightJob job = Biased("probed", 0);
  job.scenario.duration_ns = 5 * kNsPerS / 2;
  faults::FaultSpec noise;
  noise.id = "noise";
  noise.type = "sensor.noise";
  noise.parameters = {{"signal", std::string("x_m")}, {"std", 0.002}};
  faults::FaultSpec probe;
  probe.id = "probe";
  probe.type = std::string(kPlaceholderType);
  probe.start_ns = kNsPerS;
  probe.end_ns = 2 * kNsPerS;
  faults::FaultSpec later = noise;
  later.id = "later";
  later.parameters["signal"] = std::string("z_m");
  job.scenario.faults = {noise, probe, later};
  return job;
}

// Two levels of each type that may depart, at the first of its places.
std::vector<FlightJob> LevelsOfAllTypes() {
  const FlightJob base = Probed();
  std::vector<FlightJob> jobs;
  for (const faults::FaultType& type : faults::FaultTypes()) {
    if (!type.has_severity()) continue;
    FlightJob job = base;
    job.scenario =
        WithRow(base.scenario, EnvelopeRows(type, base.model->signals()).front(), base.model->signals());
    const Severity severity = SeverityOf(job.scenario, 1, base.model->signals());
    job.departure = Departure{.trunk = std::string(type.name), .fault = 1};
    if (!CanDepart(job)) continue;
    for (const double share : {0.02, 0.3}) {
      double level = severity.range.start + share * (severity.range.end - severity.range.start);
      if (severity.range.whole) level = std::round(level);
      FlightJob& at = jobs.emplace_back(job);
      at.scenario = AtLevel(job.scenario, 1, severity, level);
      at.name = fmt::format("{} {}", type.name, share);
    }
  }
  return jobs;
}

// Everything but the time that it took.
std::vector<std::vector<std::uint8_t>> ResultsOf(const std::vector<FlightJob>& jobs, int jobs_count,
                                                 std::size_t* trunks_max = nullptr) {
  Engine engine({.jobs_count = jobs_count});
  std::vector<std::future<FlightResult>> flown;
  for (const FlightJob& job : jobs) flown.push_back(engine.Submit(job));
  while (!engine.idle()) {
    engine.Poll();
    if (trunks_max != nullptr) *trunks_max = std::max(*trunks_max, engine.trunks_count());
  }
  std::vector<std::vector<std::uint8_t>> packed;
  for (auto& each : flown) {
    FlightResult result = each.get();
    EXPECT_NE(result.score.verdict, Verdict::kError) << result.name << ": " << result.score.reason;
    result.wall_s = result.real_time_factor = 0;
    packed.push_back(Pack(result));
  }
  return packed;
}

TEST(Departure, IsTheFlightFromTheBeginning) {
  const std::vector<FlightJob> jobs = LevelsOfAllTypes();
  std::set<std::string> layers;
  for (const FlightJob& job : jobs) layers.insert(job.scenario.faults[1].type.substr(0, 3));
  EXPECT_EQ(layers.size(), 7u) << "wire, frame, link, sensor, actuator, plant, harness";
  std::vector<FlightJob> whole = jobs;
  for (FlightJob& job : whole) job.departure.reset();
  std::size_t trunks_max = 0;
  const auto departed = ResultsOf(jobs, 1, &trunks_max), flown = ResultsOf(whole, 1);
  EXPECT_GT(trunks_max, 20u);
  for (std::size_t i = 0; i < jobs.size(); ++i) EXPECT_EQ(departed[i], flown[i]) << jobs[i].name;
}

std::vector<MarginTask> Tasks() {
  const FlightJob job = Biased("bias", 0.1);
  MarginTask up{job, 0, SeverityOf(job.scenario, 0, job.model->signals())};
  MarginTask down{job, 0, SeverityOf(job.scenario, 0, job.model->signals(), {.low = -5})};
  down.job.name = "down";
  return {up, down};
}

TEST(FindMargins, FindsAllAtOnceWithAnyNumberOfJobs) {
  const std::vector<MarginTask> tasks = Tasks();
  std::vector<std::optional<Margin>> first;
  for (const int jobs_count : {1, 3}) {
    Trials trials({.jobs_count = jobs_count}, 2);
    const auto margins = FindMargins(trials, tasks, {.tolerance = 0.1});
    ASSERT_EQ(margins.size(), 2u);
    EXPECT_LT(margins[0]->survives.value(), margins[0]->fails.value());
    EXPECT_GT(margins[1]->survives.value(), margins[1]->fails.value());
    EXPECT_LT(margins[1]->survives.value(), 0.0);
    if (first.empty()) first = margins;
    for (std::size_t i = 0; i < 2; ++i) {
      EXPECT_EQ(margins[i]->survives, first[i]->survives);
      EXPECT_EQ(margins[i]->fails, first[i]->fails);
      EXPECT_EQ(margins[i]->flights_count, first[i]->flights_count);
      EXPECT_EQ(margins[i]->at_fails.reason, first[i]->at_fails.reason);
    }
  }
}

TEST(FindMargins, AnErrorIsNoMarginAndCostsNoOther) {
  std::vector<MarginTask> tasks = Tasks();
  tasks[0].job.recorder.begin = [](const Scenario&) { kill(getpid(), SIGKILL); };
  Trials trials({.jobs_count = 2}, 2);
  const auto margins = FindMargins(trials, tasks, {.tolerance = 0.1});
  EXPECT_EQ(margins[0]->survives, std::nullopt);
  EXPECT_EQ(margins[0]->fails, std::nullopt);
  EXPECT_THAT(margins[0]->unknown.value().reason, HasSubstr("killed by signal 9"));
  EXPECT_TRUE(margins[1]->fails.has_value());
}

TEST(FindMargins, AnInterruptLeavesNoMargin) {
  std::atomic<bool> interrupted{false};
  Trials trials({.jobs_count = 1, .interrupted = &interrupted}, 2);
  const auto margins =
      FindMargins(trials, Tasks(),
                  {.on_level = [&](const MarginTask&, double, const TrialResult&) { interrupted = true; }});
  EXPECT_FALSE(margins[0].has_value());
  EXPECT_FALSE(margins[1].has_value());
}

}  // namespace
}  // namespace tiltproof::harness
