// Code that an image has executed in the emulator. The image is the shipped one.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>
#include <fstream>
#include <future>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include "harness/client/coverage.h"
#include "harness/emulator/lockstep_protocol.h"
#include "harness/engine/engine.h"

namespace tiltproof::harness {
namespace {

using ::testing::Contains;
using ::testing::IsEmpty;
using ::testing::Not;

FlightJob Job(const std::string& name, bool coverage) {
  std::vector<std::string> warnings;
  FlightJob job{.name = name, .scenario = {}, .model = {}, .means = {}, .replay = ""};
  job.model = std::make_shared<const plant::VehicleModel>(
      plant::LoadVehicle(std::string(TILTPROOF_SOURCE_DIR) + "/plant/models/tiltrotor.sdf", {}, warnings));
  job.scenario.name = name;
  job.scenario.duration_ns = 2 * kNsPerS;
  job.scenario.initial_position_m = {2, 0, 0.5};
  job.means.clients.all = EmulatedImage{.file = TILTPROOF_IMAGE};
  job.coverage = coverage;
  return job;
}

FlightJob WithReset(FlightJob job) {
  faults::FaultSpec reset;
  reset.id = "reset";
  reset.type = "device.reset";
  reset.start_ns = kNsPerS;
  reset.parameters = {{"boot_ms", 30.0}};
  job.scenario.faults = {reset};
  return job;
}

// The place of the first instruction. Its address is a field of the file's header (ELF, chapter 4).
std::uint32_t EntryPlace() {
  std::ifstream file(TILTPROOF_IMAGE, std::ios::binary);
  const std::string header{std::istreambuf_iterator<char>(file), {}};
  std::uint32_t entry = 0;
  std::memcpy(&entry, header.data() + 24, sizeof entry);
  return (entry - 1 - 0x0800'0000) / 2;  // a Thumb address is odd
}

TEST(EmulatorCoverage, IsTheSameEachTimeAndChangesNoFlight) {
  Engine engine({.jobs_count = 2});
  auto plain = engine.Submit(Job("plain", false));
  auto first = engine.Submit(Job("first", true));
  auto second = engine.Submit(Job("second", true));
  auto reset = engine.Submit(WithReset(Job("reset", true)));
  while (!engine.idle()) engine.Poll();
  const FlightResult without = plain.get(), with = first.get(), again = second.get(), twice = reset.get();
  ASSERT_FALSE(without.trace_hash.empty()) << without.score.reason;
  EXPECT_EQ(with.trace_hash, without.trace_hash);
  EXPECT_EQ(without.coverage_kind, CoverageKind::kBlackBox);
  EXPECT_THAT(without.coverage, IsEmpty());
  EXPECT_EQ(with.coverage_kind, CoverageKind::kBlocks);
  EXPECT_GT(with.coverage.size(), 200U);
  EXPECT_LT(with.coverage.back() / kBucketsCount, lockstep::BlockCounts::kPlacesCount);
  EXPECT_TRUE(std::ranges::is_sorted(with.coverage));
  EXPECT_EQ(again.coverage, with.coverage);
  // It begins at power-on, once.
  EXPECT_THAT(with.coverage, Contains(FeatureOf(EntryPlace(), 1)));
  EXPECT_THAT(twice.coverage, Contains(FeatureOf(EntryPlace(), 2)));
  EXPECT_THAT(twice.coverage, Not(Contains(FeatureOf(EntryPlace(), 1))));
}

}  // namespace
}  // namespace tiltproof::harness
