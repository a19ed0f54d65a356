// Flights in worker processes, against the same flights flown and scored in this process.
#include "harness/engine/engine.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <functional>
#include <future>
#include <map>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "harness/client/firmware_guard.h"
#include "harness/client/library_client.h"
#include "harness/run/flight.h"
#include "harness/scenario/shipped_protocols.h"

namespace tiltproof::harness {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

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
  return job;
}

// The same firmware as a user's file: every flight has a process of its own.
FlightJob UsersJob(const std::string& name, double duration_s = 3) {
  FlightJob job = Job(name, duration_s);
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

void PollToTheEnd(Engine& engine) {
  while (!engine.idle()) engine.Poll();
}

TEST(Engine, AFlightInAWorkerIsTheFlightInThisProcess) {
  const FlightResult here = Here(Job("spiral"));
  EXPECT_FALSE(here.trace_hash.empty());
  EXPECT_GT(here.score.faults.at(0).activations, 0);
  Engine engine({});
  std::future<FlightResult> flown = engine.Submit(Job("spiral"));
  PollToTheEnd(engine);
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
    PollToTheEnd(engine);
    EXPECT_EQ(finished.size(), 5u);
    for (int i = 0; i < 5; ++i) {
      const FlightResult result = flown[static_cast<std::size_t>(i)].get();
      EXPECT_EQ(result.name, "flight-" + std::to_string(i));
      EXPECT_EQ(result.trace_hash, Here(Job(result.name, 0.5 + 0.1 * i)).trace_hash);
    }
  }
}

TEST(Engine, CodeThatAFlightExecutesIsTheSameInEachProcess) {
  std::vector<std::vector<std::uint32_t>> short_ones, long_ones;
  std::set<std::string> hashes;
  for (const int jobs_count : {1, 2}) {
    Engine engine({.jobs_count = jobs_count});
    std::vector<std::future<FlightResult>> flown;
    for (int i = 0; i < 6; ++i) {
      FlightJob job = Job("flight-" + std::to_string(i), i % 2 == 0 ? 0.3 : 1.2);
      job.means.clients.all = HostLibrary{TILTPROOF_TRACED_FIRMWARE};
      job.coverage = i < 4;
      flown.push_back(engine.Submit(std::move(job)));
    }
    PollToTheEnd(engine);
    for (int i = 0; i < 6; ++i) {
      const FlightResult result = flown[static_cast<std::size_t>(i)].get();
      if (i % 2 == 0) hashes.insert(result.trace_hash);
      EXPECT_EQ(result.coverage_kind, i < 4 ? CoverageKind::kEdges : CoverageKind::kBlackBox);
      if (i < 4) (i % 2 == 0 ? short_ones : long_ones).push_back(result.coverage);
      EXPECT_EQ(result.coverage.empty(), i >= 4);
    }
  }
  EXPECT_EQ(hashes.size(), 1U);
  EXPECT_GT(short_ones[0].size(), 50U);
  EXPECT_TRUE(std::ranges::is_sorted(short_ones[0]));
  for (const auto& features : short_ones) EXPECT_EQ(features, short_ones[0]);
  for (const auto& features : long_ones) EXPECT_EQ(features, long_ones[0]);
  // Only there replies are missing.
  EXPECT_NE(short_ones[0], long_ones[0]);
}

TEST(Engine, WhatIsDroppedNeverFlies) {
  Engine engine({});
  auto first = engine.Submit(Job("first")), second = engine.Submit(Job("second"));
  engine.Poll();
  EXPECT_THAT(engine.DropWaiting(), ElementsAre("second"));
  PollToTheEnd(engine);
  EXPECT_EQ(first.get().name, "first");
  EXPECT_THROW(second.get(), std::future_error);
}

TEST(Engine, OnlyThoseThatArePickedAreDropped) {
  Engine engine({});
  auto first = engine.Submit(Job("first")), second = engine.Submit(Job("second")),
       third = engine.Submit(Job("third"));
  engine.DropWaiting([](const FlightJob& job) { return job.name == "second"; });
  PollToTheEnd(engine);
  EXPECT_EQ(first.get().name, "first");
  EXPECT_THROW(second.get(), std::future_error);
  EXPECT_EQ(third.get().name, "third");
}

TEST(Engine, AWorkerThatIsKilledCostsItsOwnFlight) {
  Engine engine({});
  FlightJob killed = Job("killed");
  killed.recorder.begin = [](const Scenario&) { kill(getpid(), SIGKILL); };
  auto lost = engine.Submit(std::move(killed)), whole = engine.Submit(Job("whole"));
  PollToTheEnd(engine);
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
  PollToTheEnd(engine);
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
    engine.Poll();
    EXPECT_EQ(engine.progress().size(), 1u);
  }
  EXPECT_THROW(flown.get(), std::future_error);
  EXPECT_LT(std::chrono::steady_clock::now() - began, std::chrono::seconds(60));
}

// The process that flew each flight, as the process itself reports it.
class Pids {
 public:
  Pids()
      : shared_(static_cast<Shared*>(
            mmap(nullptr, sizeof(Shared), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0))) {}
  ~Pids() { munmap(shared_, sizeof(Shared)); }
  Pids(const Pids&) = delete;
  Pids& operator=(const Pids&) = delete;

  // `then` runs in the worker.
  FlightJob Note(
      FlightJob job, std::size_t place, const std::function<void()>& then = [] {}) const {
    job.recorder.begin = [shared = shared_, place, then](const Scenario&) {
      shared->at(place) = getpid();
      then();
    };
    return job;
  }
  pid_t operator[](std::size_t place) const { return shared_->at(place); }

 private:
  using Shared = std::array<std::atomic<pid_t>, 8>;
  Shared* shared_;
};

TEST(Engine, OneProcessFliesTheShippedFirmwareAgainAndAgain) {
  const Pids pids;
  Engine engine({});
  std::vector<std::future<FlightResult>> flown;
  for (std::size_t i = 0; i < 4; ++i)
    flown.push_back(engine.Submit(pids.Note(Job("flight-" + std::to_string(i), 1), i)));
  PollToTheEnd(engine);
  EXPECT_NE(pids[0], getpid());
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(pids[i], pids[0]);
    EXPECT_EQ(flown[i].get().name, "flight-" + std::to_string(i));
  }
}

TEST(Engine, AUsersLibraryFliesInAFreshProcess) {
  const Pids pids;
  Engine engine({});
  engine.Submit(pids.Note(Job("shipped", 1), 0));
  engine.Submit(pids.Note(UsersJob("users", 1), 1));
  engine.Submit(pids.Note(UsersJob("users-again", 1), 2));
  engine.Submit(pids.Note(Job("shipped-again", 1), 3));
  PollToTheEnd(engine);
  for (std::size_t i = 1; i < 4; ++i) EXPECT_NE(pids[i], pids[i - 1]) << i;
}

// All builds of the firmware, both protocols, healthy and in trouble.
std::vector<FlightJob> AllSorts() {
  std::vector<FlightJob> jobs = {Job("paper"),   Job("longer", 4), Job("tolerant"), Job("published"),
                                 Job("provant"), Job("shaken"),    Job("reset"),    Job("broken")};
  jobs[2].scenario.firmware = "tolerant";
  jobs[3].scenario.firmware = "paper_published";
  jobs[4].scenario.link.protocol = FindProtocol("provant");
  jobs[5].scenario.faults[0].type = "wire.bit_error";
  jobs[5].scenario.faults[0].target = faults::Target::kBoth;
  jobs[5].scenario.faults[0].parameters["ber"] = 1e-3;
  jobs[6].scenario.faults[0].type = "device.reset";
  jobs[6].scenario.faults[0].end_ns = kNever;
  jobs[6].scenario.faults[0].parameters["boot_ms"] = 20.0;
  jobs[7].scenario.firmware = "no such build";
  return jobs;
}

TEST(Engine, AFlightDoesNotDependOnThoseBeforeIt) {
  const auto flown_by = [](int jobs_count, std::vector<FlightJob> jobs) {
    Engine engine({.jobs_count = jobs_count});
    std::vector<std::future<FlightResult>> futures;
    for (FlightJob& job : jobs) futures.push_back(engine.Submit(std::move(job)));
    PollToTheEnd(engine);
    std::vector<FlightResult> results;
    for (auto& future : futures) {
      results.push_back(future.get());
      results.back().wall_s = results.back().real_time_factor = 0;
    }
    return results;
  };
  std::vector<FlightResult> fresh;
  std::set<std::string> hashes;
  for (const FlightJob& job : AllSorts()) {
    fresh.push_back(flown_by(1, {job}).at(0));
    hashes.insert(fresh.back().trace_hash);
  }
  EXPECT_EQ(fresh[0].trace_hash, Here(Job("paper")).trace_hash);
  EXPECT_EQ(hashes.size(), fresh.size()) << "they all differ";

  for (const int jobs_count : {1, 2}) {
    for (const std::size_t step : {1, 3, 7}) {
      std::vector<FlightJob> jobs;
      for (std::size_t i = 0; i < fresh.size(); ++i) jobs.push_back(AllSorts()[i * step % fresh.size()]);
      const std::vector<FlightResult> results = flown_by(jobs_count, jobs);
      for (std::size_t i = 0; i < fresh.size(); ++i)
        EXPECT_EQ(Pack(results[i]), Pack(fresh[i * step % fresh.size()])) << jobs[i].name;
    }
  }
}

TEST(Engine, AWorkerThatIsKilledInItsSecondFlightCostsThatFlight) {
  const Pids pids;
  Engine engine({});
  auto first = engine.Submit(pids.Note(Job("first", 1), 0));
  auto lost = engine.Submit(pids.Note(Job("lost", 1), 1, [] { kill(getpid(), SIGKILL); }));
  auto third = engine.Submit(pids.Note(Job("third", 1), 2)),
       fourth = engine.Submit(pids.Note(Job("fourth", 1), 3));
  PollToTheEnd(engine);
  EXPECT_EQ(first.get().trace_hash, Here(Job("first", 1)).trace_hash);
  EXPECT_EQ(pids[1], pids[0]);
  EXPECT_THAT(lost.get().score.reason,
              HasSubstr("the worker process was killed by signal 9 (Killed) at 0.000 s of the flight"));
  EXPECT_NE(pids[2], pids[0]);
  EXPECT_EQ(pids[3], pids[2]);
  EXPECT_EQ(third.get().trace_hash, Here(Job("third", 1)).trace_hash);
  EXPECT_EQ(fourth.get().trace_hash, Here(Job("fourth", 1)).trace_hash);
}

TEST(Engine, AWorkerThatDiesBetweenTwoFlightsCostsNone) {
  const Pids pids;
  std::vector<std::string> told;
  Engine engine({.on_finished =
                     [&](const FlightJob& job, const FlightResult&) {
                       if (job.name == "first") kill(pids[0], SIGKILL);
                     },
                 .tell = [&](const std::string& line) { told.push_back(line); }});
  auto first = engine.Submit(pids.Note(Job("first", 1), 0)),
       second = engine.Submit(pids.Note(Job("second", 1), 1));
  PollToTheEnd(engine);
  EXPECT_EQ(first.get().trace_hash, Here(Job("first", 1)).trace_hash);
  EXPECT_EQ(second.get().trace_hash, Here(Job("second", 1)).trace_hash);
  EXPECT_NE(pids[1], pids[0]);
  EXPECT_THAT(told, IsEmpty());
}

TEST(Engine, AWorkerWhoseFirmwareWasStoppedFliesNoMore) {
  const Pids pids;
  Engine engine({});
  FlightJob job = pids.Note(Job("first", 1), 0);
  job.recorder.end = [](const Scenario&, const RunLog&, const FlightResult&) {
    EXPECT_THROW(FirmwareGuard::Call(FirmwareCall::kStatus, [] { raise(SIGSEGV); }), FirmwareTrouble);
  };
  auto first = engine.Submit(std::move(job)), second = engine.Submit(pids.Note(Job("second", 1), 1));
  PollToTheEnd(engine);
  EXPECT_EQ(first.get().trace_hash, second.get().trace_hash);
  EXPECT_NE(pids[1], pids[0]);
}

TEST(Engine, WhatCannotBeRecordedCostsNoWorker) {
  const Pids pids;
  Engine engine({});
  FlightJob job = pids.Note(Job("full-disk", 1), 0);
  job.recorder.end = [](const Scenario&, const RunLog&, const FlightResult&) {
    throw std::runtime_error("no space left on device");
  };
  auto first = engine.Submit(std::move(job)), second = engine.Submit(pids.Note(Job("second", 1), 1));
  PollToTheEnd(engine);
  EXPECT_EQ(first.get().score.reason, "the flight's results are missing: no space left on device");
  EXPECT_EQ(second.get().trace_hash, Here(Job("second", 1)).trace_hash);
  EXPECT_EQ(pids[1], pids[0]);
}

TEST(Engine, WhatComesLaterFliesToo) {
  const Pids pids;
  std::vector<std::future<FlightResult>> later;
  Engine* in_use = nullptr;
  Engine engine({.on_finished = [&](const FlightJob& job, const FlightResult&) {
    if (job.name == "first") later.push_back(in_use->Submit(pids.Note(Job("later", 1), 2)));
  }});
  in_use = &engine;
  auto first = engine.Submit(pids.Note(Job("first", 1), 0)),
       second = engine.Submit(pids.Note(Job("second", 1), 1));
  PollToTheEnd(engine);
  EXPECT_EQ(pids[1], pids[0]);
  EXPECT_NE(pids[2], pids[0]) << "it was forked without it";
  later.push_back(engine.Submit(pids.Note(Job("much-later", 1), 3)));
  PollToTheEnd(engine);
  EXPECT_EQ(later.at(0).get().name, "later");
  EXPECT_EQ(later.at(1).get().name, "much-later");
}

TEST(Engine, WhatIsDroppedWhenAFlightEndsNeverFlies) {
  Engine* in_use = nullptr;
  Engine engine({.on_finished = [&](const FlightJob&, const FlightResult&) {
    EXPECT_THAT(in_use->DropWaiting(), ElementsAre("second", "third"));
  }});
  in_use = &engine;
  auto first = engine.Submit(Job("first", 1)), second = engine.Submit(Job("second", 1)),
       third = engine.Submit(Job("third", 1));
  PollToTheEnd(engine);
  EXPECT_EQ(first.get().name, "first");
  EXPECT_THROW(second.get(), std::future_error);
  EXPECT_THROW(third.get(), std::future_error);
}

std::atomic<bool> interrupted{false};

class InterruptedEngine : public ::testing::Test {
 protected:
  void SetUp() override {
    interrupted = false;
    was_ = signal(SIGINT, [](int) { interrupted = true; });
  }
  void TearDown() override { signal(SIGINT, was_); }

 private:
  void (*was_)(int) = nullptr;
};

TEST_F(InterruptedEngine, KeepsThePartOfItsFlightAndBeginsNoOther) {
  Engine engine({.interrupted = &interrupted});
  auto first = engine.Submit(Job("first", 1)), second = engine.Submit(Job("second", 3600)),
       third = engine.Submit(Job("third", 1));
  while (!engine.idle()) {
    engine.Poll();
    const auto progress = engine.progress();
    if (!interrupted && !progress.empty() && progress[0].name == "second" && progress[0].flown_s > 1)
      raise(SIGINT);
  }
  EXPECT_EQ(first.get().end_reason, EndReason::kCompleted);
  const FlightResult cut = second.get();
  EXPECT_EQ(cut.end_reason, EndReason::kInterrupted);
  EXPECT_FALSE(cut.trace_hash.empty());
  EXPECT_THAT(engine.DropWaiting(), ElementsAre("third"));
  EXPECT_THROW(third.get(), std::future_error);
}

TEST_F(InterruptedEngine, ASignalToAWorkerAloneCostsItsFlight) {
  const Pids pids;
  Engine engine({.interrupted = &interrupted});
  auto first = engine.Submit(pids.Note(Job("first", 1), 0)),
       second = engine.Submit(pids.Note(Job("second", 1), 1, [] { raise(SIGINT); })),
       third = engine.Submit(pids.Note(Job("third", 1), 2));
  PollToTheEnd(engine);
  EXPECT_EQ(first.get().end_reason, EndReason::kCompleted);
  EXPECT_EQ(pids[1], pids[0]);
  const Score ended = second.get().score;
  EXPECT_THAT(ended.reason, HasSubstr("a signal ended the worker process alone"));
  EXPECT_EQ(ended.cause, VerdictCause::kHarness);
  EXPECT_EQ(third.get().end_reason, EndReason::kCompleted);
  EXPECT_NE(pids[2], pids[0]);
}

TEST_F(InterruptedEngine, ASignalToAWorkerBetweenTwoFlightsCostsNone) {
  const Pids pids;
  Engine engine({.on_finished =
                     [&](const FlightJob& job, const FlightResult&) {
                       if (job.name == "first") kill(pids[0], SIGINT);
                     },
                 .interrupted = &interrupted});
  auto first = engine.Submit(pids.Note(Job("first", 1), 0)),
       second = engine.Submit(pids.Note(Job("second", 1), 1));
  PollToTheEnd(engine);
  EXPECT_EQ(first.get().end_reason, EndReason::kCompleted);
  EXPECT_EQ(second.get().end_reason, EndReason::kCompleted);
  EXPECT_NE(pids[1], pids[0]);
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
