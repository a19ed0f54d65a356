#include <gtest/gtest.h>

#include <cmath>

#include "tests/faults/faulty_line.h"
#include "tests/faults/goodness_of_fit.h"

namespace tiltproof::faults {
namespace {

TEST(StuckByteTest, ReplacesRunsOfBytes) {
  FaultSchedule schedule =
      AtTheLine({Spec("wire.stuck_byte", {{"value", 255.0}, {"length_bytes", 5.0}, {"rate_hz", 20.0}})}, 1);
  const auto out = Send(schedule, 50'000);
  int whole_runs = 0;
  double hit_frames = 0;
  for (std::size_t n = 0; n < out.size(); ++n) {
    const link::Chunk before = Frame(static_cast<std::int64_t>(n));
    const link::Chunk& after = out[n].at(0);
    ASSERT_EQ(after.bytes.size(), before.bytes.size());
    std::vector<std::size_t> stuck;
    for (std::size_t i = 0; i < before.bytes.size(); ++i) {
      if (after.bytes[i] == before.bytes[i]) continue;
      ASSERT_EQ(after.bytes[i], 255);
      stuck.push_back(i);
    }
    if (stuck.empty()) continue;
    ++hit_frames;
    if (stuck.front() > 0 && stuck.back() < 67 && stuck.size() <= 5) {
      whole_runs += stuck.back() - stuck.front() == 4 ? 1 : 0;
    }
  }
  // An event hits when it comes in the frame or within five byte times before it.
  const double seconds = 50'000 * 72 * 10 / 921'600.0;
  EXPECT_NEAR(hit_frames, 20.0 * seconds, 5 * std::sqrt(20.0 * seconds));
  EXPECT_GT(whole_runs, 0.8 * hit_frames);
}

// Events of a Poisson process: each byte time has one with the same probability, independently of the others.
TEST(StuckByteTest, EventsComeAsAPoissonProcess) {
  constexpr double kRate_hz = 5000;
  const Bytes before = DistinctBytes();
  std::vector<bool> stuck;
  for (const auto& chunks : SendWithoutPause(
           Spec("wire.stuck_byte", {{"value", 255.0}, {"length_bytes", 1.0}, {"rate_hz", kRate_hz}}), before,
           20'000)) {
    for (const std::uint8_t byte : chunks.at(0).bytes) stuck.push_back(byte == 255);
  }
  EXPECT_TRUE(AreBernoulli(stuck, 1 - std::exp(-kRate_hz * 10 / 921'600)));  // some 106 000 of them
}

TEST(StuckByteTest, AByteThatHasTheValueIsNoChange) {
  FaultSchedule schedule = AtTheLine(
      {Spec("wire.stuck_byte", {{"value", 0.0}, {"length_bytes", 1000.0}, {"rate_hz", 1000.0}})}, 1);
  schedule.SetOrigin(kOriginAtPowerOn);
  for (int n = 0; n < 100; ++n) {
    link::Chunk chunk;
    chunk.begin_ns = BootTime(n * kNsPerMs);
    chunk.bytes.assign(20, 0);
    std::vector<link::Chunk> chunks = {chunk};
    schedule.Filter(link::Direction::kToClient)->Apply(chunks);
  }
  EXPECT_EQ(schedule.ActivationCounts().at(0), 0);
}

}  // namespace
}  // namespace tiltproof::faults
