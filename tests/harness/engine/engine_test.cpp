// Flights in worker processes, against the same flights flown and scored in this process.
#include "harness/engine/engine.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <chrono>
#include <future>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "harness/client/library_client.h"
#include "harness/run/flight.h"

namespace tiltproof::harness {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::shared_ptr<const plant::VehicleModel> Model() {
  static const auto model = [] {
    std::vector<std::string> warnings;
    return std::make_shared<const plant::VehicleModel>(
        plant::LoadVehicle(std::string(TILTPROOF_SOURCE_DIR) + "/plant/models/tiltrotor.sdf", {}, warnings));
  }();
  return model;
}

FlightJob Job(const std::string& name, double duration_s = 3) {
  FlightJob job{.name = name, .scenario = {}, .model = Model(), .means = {}, .replay = "again " + name};
  job.scenario.name = name;
  job.scenario.duration_ns = FromSeconds(duration_s);
  job.scenario.initial_position_m = {2, 0, 0.5};
  faults::FaultSpec lost;
  lost.id = "lost";
  lost.type = "link.silence";
  lost.start_ns = kNsPerS;
  lost.end_ns = kNsPerS + 20 * kNsPerMs;
  job.scenario.faults = {lost};
  job.means.clients.all = HostLibrary{TILTPROOF_FIRMWARE_LIBRARY};
  return job;
}

FlightResult Here(const FlightJob& job) {
  FlightOptions options;
  options.make_client = [&](std::size_t /*client*/, ClientHost host) {
    return LoadLibraryClient(TILTPROOF_FIRMWARE_LIBRARY, job.scenario.firmware,
                             job.scenario.link.protocol->name, std::move(host));
  };
  return MakeResult(job.name, job.scenario, Fly(job.scenario, *job.model, options), job.replay);
}

void ExpectSameFlight(const FlightResult& a, const FlightResult& b) {
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(a.trace_hash, b.trace_hash);
  EXPECT_EQ(a.score.verdict, b.score.verdict);
  EXPECT_EQ(a.score.reason, b.score.reason);
  EXPECT_EQ(a.score.metrics, b.score.metrics);
  EXPECT_EQ(a.score.histograms, b.score.histograms);
  ASSERT_EQ(a.score.criteria.size(), b.score.criteria.size());
  for (std::size_t i = 0; i < a.score.criteria.size(); ++i) {
    EXPECT_EQ(a.score.criteria[i].name, b.score.criteria[i].name);
    EXPECT_EQ(a.score.criteria[i].robustness, b.score.criteria[i].robustness);
    EXPECT_EQ(a.score.criteria[i].explanation, b.score.criteria[i].explanation);
  }
  ASSERT_EQ(a.score.faults.size(), 1u);
  EXPECT_EQ(a.score.faults[0].activations, b.score.faults[0].activations);
  ASSERT_EQ(a.events.size(), b.events.size());
  for (std::size_t i = 0; i < a.events.size(); ++i) EXPECT_EQ(a.events[i].text, b.events[i].text);
  EXPECT_EQ(a.replay, b.replay);
}

void TurnToTheEnd(Engine& engine) {
  while (!engine.idle()) engine.Turn();
}

TEST(Engine, AFlightInAWorkerIsTheFlightInThisProcess) {
  const FlightResult here = Here(Job("spiral"));
  EXPECT_FALSE(here.trace_hash.empty());
  EXPECT_GT(here.score.faults.at(0).activations, 0);
  Engine engine({});
  std::future<FlightResult> flown = engine.Submit(Job("spiral"));
  TurnToTheEnd(engine);
  ExpectSameFlight(flown.get(), here);
}

TEST(Engine, TheNumberOfJobsChangesNoResult) {
  for (const int jobs_count : {1, 3}) {
    std::vector<std::string> finished;
    Engine engine(
        {.jobs_count = jobs_count, .on_finished = [&](const FlightJob& job, const FlightResult& result) {
           EXPECT_EQ(job.name, result.name);
           finished.push_back(result.name);
         }});
    std::vector<std::future<FlightResult>> flown;
    for (int i = 0; i < 5; ++i)
      flown.push_back(engine.Submit(Job("flight-" + std::to_string(i), 0.5 + 0.1 * i)));
    TurnToTheEnd(engine);
    EXPECT_EQ(finished.size(), 5u);
    for (int i = 0; i < 5; ++i) {
      const FlightResult result = flown[static_cast<std::size_t>(i)].get();
      EXPECT_EQ(result.name, "flight-" + std::to_string(i));
      EXPECT_EQ(result.trace_hash, Here(Job(result.name, 0.5 + 0.1 * i)).trace_hash);
    }
  }
}

TEST(Engine, WhatIsDroppedNeverFlies) {
  Engine engine({});
  auto first = engine.Submit(Job("first")), second = engine.Submit(Job("second"));
  engine.Turn();
  EXPECT_THAT(engine.DropWaiting(), ElementsAre("second"));
  TurnToTheEnd(engine);
  EXPECT_EQ(first.get().name, "first");
  EXPECT_THROW(second.get(), std::future_error);
}

TEST(Engine, AWorkerThatIsKilledCostsItsOwnFlight) {
  Engine engine({});
  FlightJob killed = Job("killed");
  killed.recorder.begin = [](const Scenario&) { kill(getpid(), SIGKILL); };
  auto lost = engine.Submit(std::move(killed)), whole = engine.Submit(Job("whole"));
  TurnToTheEnd(engine);
  const FlightResult result = lost.get();
  EXPECT_EQ(result.score.verdict, Verdict::kError);
  EXPECT_THAT(result.score.reason, HasSubstr("the worker process was killed by signal 9"));
  EXPECT_TRUE(result.trace_hash.empty());
  EXPECT_FALSE(whole.get().trace_hash.empty());
}

TEST(Engine, WhatCannotBeRecordedIsAnError) {
  Engine engine({});
  FlightJob job = Job("full-disk");
  job.recorder.end = [](const Scenario&, const RunLog&, const FlightResult&) {
    throw std::runtime_error("no space left on device");
  };
  auto flown = engine.Submit(std::move(job));
  TurnToTheEnd(engine);
  const FlightResult result = flown.get();
  EXPECT_EQ(result.score.verdict, Verdict::kError);
  EXPECT_EQ(result.score.reason, "the flight's results are missing: no space left on device");
}

TEST(Engine, TheEndOfTheEngineIsTheEndOfItsWorkers) {
  std::future<FlightResult> flown;
  const auto began = std::chrono::steady_clock::now();
  {
    Engine engine({});
    FlightJob job = Job("for-ever");
    job.recorder.begin = [](const Scenario&) {
      while (true) pause();
    };
    flown = engine.Submit(std::move(job));
    engine.Turn();
    EXPECT_EQ(engine.progress().size(), 1u);
  }
  EXPECT_THROW(flown.get(), std::future_error);
  EXPECT_LT(std::chrono::steady_clock::now() - began, std::chrono::seconds(60));
}

TEST(FlightResult, ComesBackToTheBit) {
  FlightResult result = Here(Job("spiral"));
  result.score.criteria.push_back({"c", Verdict::kInconclusive, std::nullopt, 1.5, "why", -0.0});
  result.events.push_back({-5, "kind", "client", std::string("a\0b\n", 4)});
  const FlightResult again = UnpackFlightResult(Pack(result));
  EXPECT_EQ(Pack(again), Pack(result));
  ExpectSameFlight(again, result);
  EXPECT_EQ(again.events.back().text, result.events.back().text);
  // Cut anywhere, it is no result.
  const auto bytes = Pack(result);
  for (std::size_t size = 0; size < bytes.size(); size += 97)
    EXPECT_THROW(UnpackFlightResult({bytes.data(), size}), std::runtime_error) << size;
}

}  // namespace
}  // namespace tiltproof::harness
