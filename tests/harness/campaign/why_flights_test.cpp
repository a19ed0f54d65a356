// Futures of real flights: against the flight itself, against the same futures flown from the beginning, and against flights
// whose faults end earlier by their scenario.
#include "harness/campaign/why_flights.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "harness/score/headline.h"

namespace tiltproof::harness {
namespace {

using ::testing::ElementsAre;

constexpr TimeNs kPeriod = 12 * kNsPerMs;

std::shared_ptr<const plant::VehicleModel> ModelOf(const std::string& name) {
  static std::map<std::string, std::shared_ptr<const plant::VehicleModel>> models;
  auto& model = models[name];
  std::vector<std::string> warnings;
  if (!model)
    model = std::make_shared<const plant::VehicleModel>(plant::LoadVehicle(
        std::string(TILTPROOF_SOURCE_DIR) + "/plant/models/" + name + ".sdf", {}, warnings));
  return model;
}

FlightJob Job(std::vector<faults::FaultSpec> faults, const CriterionSpec& criterion, double duration_s = 6) {
  FlightJob job{.name = "flight", .scenario = {}, .model = ModelOf("tiltrotor"), .means = {}, .replay = {}};
  job.scenario.name = "flight";
  job.scenario.duration_ns = FromSeconds(duration_s);
  job.scenario.reference.path = HoverReference{{0, 0, 2}, 0};
  job.scenario.initial_position_m = {0, 0, 2};
  job.scenario.faults = std::move(faults);
  job.scenario.criteria = {criterion};
  return job;
}

faults::FaultSpec Fault(const std::string& id, const std::string& type, double start_s,
                        std::map<std::string, faults::ParameterValue> parameters = {}) {
  faults::FaultSpec fault;
  fault.id = id;
  fault.type = type;
  fault.start_ns = FromSeconds(start_s);
  fault.parameters = std::move(parameters);
  if (type.starts_with("frame.") || type.starts_with("link.")) fault.target = faults::Target::kToClient;
  return fault;
}

CriterionSpec Near(double limit_m) {
  return {.name = "near",
          .stl = "always(position_error_m <= " + std::to_string(limit_m) + ")",
          .metric = {},
          .min = {},
          .max = {}};
}

// Replies are lost at random.
FlightJob Lossy(double probability, double duration_s = 4) {
  return Job({Fault("loss", "frame.drop", 0.5, {{"probability", probability}})}, Near(1), duration_s);
}

std::vector<FlightResult> FlyAll(const std::vector<FlightJob>& jobs) {
  Engine engine({.jobs_count = 1});
  std::vector<std::future<FlightResult>> flown;
  for (const FlightJob& job : jobs) flown.push_back(engine.Submit(job));
  while (!engine.idle()) engine.Poll();
  std::vector<FlightResult> results;
  for (auto& each : flown) results.push_back(each.get());
  return results;
}

// The reports of forked futures, by moment and number.
std::map<std::pair<std::uint32_t, std::uint32_t>, FutureReport> Forked(FlightJob job, FutureForks forks,
                                                                       std::string* whole_hash = nullptr,
                                                                       bool hashes = true) {
  std::array<int, 2> ends{};
  EXPECT_EQ(pipe2(ends.data(), O_CLOEXEC), 0);
  forks.channel = ends[1];
  if (!forks.fails) forks.fails = [](const Score& score) { return score.verdict == Verdict::kFail; };
  forks.hashes = hashes;
  job.forks = std::move(forks);
  const FlightResult whole = FlyAll({job}).front();
  close(ends[1]);
  if (whole_hash != nullptr) *whole_hash = whole.trace_hash;
  std::map<std::pair<std::uint32_t, std::uint32_t>, FutureReport> reports;
  FutureReport report;
  while (read(ends[0], &report, sizeof report) == static_cast<ssize_t>(sizeof report))
    EXPECT_TRUE(reports.emplace(std::pair(report.moment, report.number), report).second);
  close(ends[0]);
  return reports;
}

TEST(ForkedFutures, AFutureThatChangesNothingIsTheFlight) {
  const FlightJob job = Lossy(0.2);
  const std::string hash = FlyAll({job}).front().trace_hash;
  std::string whole_hash;
  const auto reports = Forked(job,
                              {.moments = {0, kNsPerS, kNsPerS + 1, 2 * kNsPerS, 4 * kNsPerS - 1},
                               .futures_count = 2,
                               .jobs_count = 2,
                               .make = [](std::size_t, std::uint32_t) { return Future{}; }},
                              &whole_hash);
  EXPECT_EQ(whole_hash, hash);
  EXPECT_GE(reports.size(), 9u);
  for (const auto& [place, report] : reports) EXPECT_EQ(report.hash.data(), hash);
}

TEST(ForkedFutures, AreTheFuturesFlownFromTheBeginning) {
  const FlightJob job = Lossy(0.2);
  const std::vector<TimeNs> moments = {kNsPerS / 2, 1500 * kNsPerMs, 3 * kNsPerS};
  for (const bool cut : {false, true}) {
    const auto make = [&](std::size_t moment, std::uint32_t number) {
      return Future{.from_ns = moments[moment],
                    .cut = cut ? std::vector<std::size_t>{0} : std::vector<std::size_t>{},
                    .draw = number + 1};
    };
    const auto forked = Forked(job, {.moments = moments, .futures_count = 3, .jobs_count = 2, .make = make});
    std::set<std::string> hashes;
    for (std::uint32_t moment = 0; moment < 3; ++moment)
      for (std::uint32_t number = 0; number < (cut ? 1u : 3u); ++number) {
        FlightJob again = job;
        again.future = make(moment, number);
        const FlightResult result = FlyAll({again}).front();
        const FutureReport& report = forked.at({moment, number});
        EXPECT_EQ(report.hash.data(), result.trace_hash);
        EXPECT_EQ(report.verdict, result.score.verdict);
        EXPECT_EQ(report.drew, !result.is_of_any_seed);
        EXPECT_EQ(report.drew, !cut);
        hashes.insert(result.trace_hash);
      }
    // Futures differ: by their draws, or by the time at which the fault ends.
    EXPECT_EQ(hashes.size(), cut ? 3u : 9u);
  }
}

// A fault that is cut at a moment is a fault whose window ends there.
TEST(ForkedFutures, ACutIsTheEndOfAWindow) {
  const std::vector<FlightJob> jobs = {
      Job({Fault("late", "frame.delay", 1, {{"mean_ms", 7.0}})}, Near(9), 4),
      Job({Fault("bias", "sensor.bias", 1, {{"signal", "x_m"}, {"offset", 0.5}})}, Near(9), 4),
      Job({Fault("weak", "actuator.loss_of_effectiveness", 1, {{"actuator", "f_r"}, {"factor", 0.9}})},
          Near(9), 4),
      Job({Fault("slow", "clock.drift", 1, {{"ppm", 9000.0}})}, Near(9), 4)};
  for (const FlightJob& job : jobs) {
    FlightJob shorter = job, future = job;
    shorter.scenario.faults[0].end_ns = 2004 * kNsPerMs;
    future.future = Future{.from_ns = 2004 * kNsPerMs, .cut = {0}, .draw = 0};
    const auto results = FlyAll({job, shorter, future});
    EXPECT_EQ(results[1].trace_hash, results[2].trace_hash) << job.scenario.faults[0].type;
    EXPECT_NE(results[0].trace_hash, results[2].trace_hash) << job.scenario.faults[0].type;
  }
}

// A judge of one criterion leaves out what it does not need.
TEST(ForkedFutures, FailByOneCriterionAsByAll) {
  FlightJob job = Job({Fault("loss", "frame.drop", 1, {{"probability", 1.0}})}, Near(0.4), 3);
  job.scenario.firmware = "tolerant";
  job.scenario.criteria.push_back(
      {.name = "normal", .stl = "always(supervisor_state < 2)", .metric = {}, .min = {}, .max = {}});
  job.scenario.criteria.push_back(
      {.name = "heard", .stl = {}, .metric = "timing.firmware_missed_count", .min = {}, .max = 40});
  const std::vector<TimeNs> moments = {1005 * kNsPerMs, 1100 * kNsPerMs, 2 * kNsPerS};
  for (const std::string name : {"near", "normal", "heard", "survival", "control_period", "clean_line"}) {
    FutureForks forks{.moments = moments, .futures_count = 1, .make = [&](std::size_t moment, std::uint32_t) {
                        return Future{.from_ns = moments[moment], .cut = {0}, .draw = 1};
                      }};
    forks.fails = [&](const Score& score) {
      return std::ranges::any_of(score.criteria, [&](const CriterionResult& criterion) {
        return criterion.name == name && criterion.verdict == Verdict::kFail;
      });
    };
    const auto by_all = Forked(job, forks);
    forks.criterion = name;
    const auto by_one = Forked(job, forks, nullptr, false);
    ASSERT_EQ(by_all.size(), moments.size());
    ASSERT_EQ(by_one.size(), moments.size());
    for (const auto& [place, report] : by_all) EXPECT_EQ(by_one.at(place).fails, report.fails) << name;
    EXPECT_FALSE(by_all.at({0, 0}).fails) << name;
    EXPECT_EQ(by_all.at({2, 0}).fails, name == "normal") << name;
  }
}

struct Lost {
  std::optional<double> last_chance_s, point_of_no_return_s;
};

Lost FindLost(const FlightJob& job, bool may_fork = true) {
  const FlightResult failed = FlyAll({job}).front();
  const CriterionResult* criterion = FirstViolated(failed.score);
  EXPECT_NE(criterion, nullptr) << failed.score.reason;
  if (criterion == nullptr) return {};
  WhyFlights flights(job, criterion->name, {.jobs_count = 2, .futures_count = 20, .may_fork = may_fork});
  TimeNs begin_ns = kNever;
  for (const auto& fault : job.scenario.faults) begin_ns = std::min(begin_ns, fault.start_ns);
  const TimeNs end_ns = criterion->time_s ? FromSeconds(*criterion->time_s) : job.scenario.duration_ns;
  const NoReturn found = FindNoReturn({begin_ns - begin_ns % kPeriod, end_ns, kPeriod},
                                      [&](const std::vector<TimeNs>& t) { return flights.Futures(t); });
  return {found.last_chance_s, found.point_of_no_return_s};
}

// 10 flights that may miss so many commands: each period of silence costs one.
TEST(WhyFlights, FindsPlantedNumbersOfMissedPeriods) {
  int found_count = 0;
  for (int i = 0; i < 10; ++i) {
    const double start_s = 1 + 0.137 * i;
    const int allowed = 3 + 2 * i;
    FlightJob job = Job(
        {Fault("silence", "link.silence", start_s)},
        {.name = "hears", .stl = {}, .metric = "timing.firmware_missed_count", .min = {}, .max = allowed});
    job.scenario.held = true;
    const double known_s = start_s + 0.012 * allowed;
    const Lost lost = FindLost(job);
    found_count += std::abs(lost.point_of_no_return_s.value_or(-1) - known_s) <= 0.05 ? 1 : 0;
    EXPECT_NEAR(lost.point_of_no_return_s.value_or(-1), known_s, 0.05);
  }
  EXPECT_EQ(found_count, 10);
}

// 10 flights that the dynamics decide: the latest end of the fault that the flight survives, by flights with such ends.
TEST(WhyFlights, FindsTheLatestEndThatIsSurvived) {
  int found_count = 0;
  for (int i = 0; i < 10; ++i) {
    const double start_s = 1 + 0.05 * i;
    FlightJob job;
    if (i % 3 == 0)
      job = Job({Fault("late", "frame.delay", start_s, {{"mean_ms", 11.0 + i}})}, Near(0.4));
    else if (i % 3 == 1)
      job = Job({Fault("bias", "sensor.bias", start_s, {{"signal", "y_m"}, {"offset", 1.0 + 0.1 * i}})},
                Near(0.4));
    else
      job = Job({Fault("weak", "actuator.loss_of_effectiveness", start_s,
                       {{"actuator", "f_r"}, {"factor", 0.1 + 0.04 * i}})},
                Near(0.4));
    const FlightResult failed = FlyAll({job}).front();
    ASSERT_EQ(failed.score.verdict, Verdict::kFail) << i << ": " << failed.score.reason;
    TimeNs survived = job.scenario.faults[0].start_ns, lost = job.scenario.duration_ns;
    while (lost - survived > 2 * kNsPerMs) {
      FlightJob shorter = job;
      shorter.scenario.faults[0].end_ns = survived + (lost - survived) / 2;
      const bool fails = FlyAll({shorter}).front().score.verdict == Verdict::kFail;
      (fails ? lost : survived) = shorter.scenario.faults[0].end_ns;
    }
    const Lost found = FindLost(job);
    EXPECT_NEAR(found.point_of_no_return_s.value_or(-1), ToSeconds(lost), 0.5) << i;
    found_count += std::abs(found.point_of_no_return_s.value_or(-1) - ToSeconds(lost)) <= 0.5 ? 1 : 0;
  }
  EXPECT_GE(found_count, 9);
}

TEST(WhyFlights, ForkedOrFlownAgainIsTheSame) {
  const FlightJob job = Job({Fault("late", "frame.delay", 1, {{"mean_ms", 14.0}})}, Near(0.4));
  const Lost forked = FindLost(job), again = FindLost(job, false);
  EXPECT_EQ(forked.point_of_no_return_s, again.point_of_no_return_s);
  EXPECT_EQ(forked.last_chance_s, again.last_chance_s);
}

// Two faults that break the flight each alone, and one that does nothing.
TEST(WhyFlights, FindsEachFaultThatSuffices) {
  const FlightJob job =
      Job({Fault("late", "frame.delay", 1, {{"mean_ms", 14.0}}), Fault("null", "harness.null", 0),
           Fault("weak", "actuator.loss_of_effectiveness", 1, {{"actuator", "f_r"}, {"factor", 0.0}})},
          Near(0.4));
  WhyFlights flights(job, "near", {.jobs_count = 2});
  const Causes causes = FindCauses(
      {0, 1, 2}, [&](const std::vector<FaultSet>& sets) { return flights.FailsWith(sets); }, 50);
  EXPECT_THAT(causes.needed, ::testing::IsEmpty());
  EXPECT_THAT(causes.sets, ElementsAre(FaultSet{0}, FaultSet{2}));
}

// A fault that follows another one does nothing without it.
TEST(WhyFlights, RemovesAFaultThatOthersFollow) {
  FlightJob job =
      Job({Fault("first", "frame.drop", 1, {{"probability", 1.0}}),
           Fault("weak", "actuator.loss_of_effectiveness", 0, {{"actuator", "f_r"}, {"factor", 0.0}})},
          Near(0.4));
  job.scenario.faults[0].end_ns = 1020 * kNsPerMs;
  job.scenario.faults[1].start_ns = kPowerOn;
  job.scenario.faults[1].after = faults::After{"first", kNsPerS};
  WhyFlights flights(job, "near", {});
  EXPECT_THAT(flights.FailsWith({{0, 1}, {1}, {0}, {}}), ElementsAre(true, false, false, false));
}

}  // namespace
}  // namespace tiltproof::harness
