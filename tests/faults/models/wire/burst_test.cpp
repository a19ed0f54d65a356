#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/faults/faulty_line.h"
#include "tests/faults/goodness_of_fit.h"

namespace tiltproof::faults {
namespace {

// A line without pauses: frame n follows n - 1 directly. Gives which bits of it flip, as one sequence.
std::vector<bool> BusyLine(double length_bits, double density, double rate_hz, std::int64_t count) {
  FaultSchedule schedule = AtTheLine(
      {Spec("wire.burst", {{"length_bits", length_bits}, {"density", density}, {"rate_hz", rate_hz}})}, 1);
  schedule.SetOrigin(kOriginAtPowerOn);
  std::vector<bool> flipped;
  for (std::int64_t n = 0; n < count; ++n) {
    link::Chunk frame = Frame(n);
    frame.begin_ns = BootTime(link::BytesTime(921'600, 68 * n));
    std::vector<link::Chunk> chunks = {frame};
    schedule.Filter(link::Direction::kToClient)->Apply(chunks);
    std::vector<bool> bits(544, false);
    for (const std::size_t bit : FlippedBits(frame, chunks.at(0))) bits[bit] = true;
    flipped.insert(flipped.end(), bits.begin(), bits.end());
  }
  return flipped;
}

TEST(BurstTest, BurstsHaveTheirLengthAcrossFramesAndTheirRate) {
  // 20 s at 20 Hz: bursts are 50 ms apart, so they rarely touch.
  const auto flipped = BusyLine(24, 1.0, 20.0, 27'106);
  std::vector<std::size_t> lengths;
  int across = 0;
  for (std::size_t i = 0; i < flipped.size();) {
    std::size_t end = i;
    while (end < flipped.size() && flipped[end] == flipped[i]) ++end;
    if (flipped[i]) {
      lengths.push_back(end - i);
      across += i / 544 != (end - 1) / 544 ? 1 : 0;
    }
    i = end;
  }
  EXPECT_NEAR(static_cast<double>(lengths.size()), 400.0, 100.0);
  const auto exact = std::count(lengths.begin(), lengths.end(), 24U);
  EXPECT_GE(static_cast<double>(exact), 0.98 * static_cast<double>(lengths.size()));
  // 23 of 544 places of a burst straddle two frames.
  EXPECT_NEAR(across, 17.0, 16.0);
  EXPECT_GT(across, 0);
}

// Bursts of one bit: each bit time has one with the same probability, independently of the others. Two in one bit
// flip it back.
TEST(BurstTest, ComeAsAPoissonProcess) {
  constexpr double kRate_hz = 5000, kPerBit = kRate_hz * 10 / 8 / 921'600;
  const auto flipped = BusyLine(1, 1.0, kRate_hz, 28'000);
  EXPECT_TRUE(AreBernoulli(flipped, (1 - std::exp(-2 * kPerBit)) / 2));  // some 103 000 of them
}

// The same seed has its bursts at the same places, whatever their density. Those that touch no other are looked at.
TEST(BurstTest, EachBitOfABurstFlipsForItself) {
  constexpr std::size_t kLength = 24;
  const auto whole = BusyLine(kLength, 1.0, 500.0, 16'500), some = BusyLine(kLength, 0.3, 500.0, 16'500);
  std::vector<bool> hit;
  for (std::size_t i = 0, end = 0; i < whole.size(); i = end) {
    for (end = i; end < whole.size() && whole[end] == whole[i]; ++end) {
    }
    if (whole[i] && end - i == kLength)
      for (std::size_t bit = i; bit < end; ++bit) hit.push_back(some[bit]);
  }
  EXPECT_GT(hit.size(), 100'000U);
  EXPECT_TRUE(AreBernoulli(hit, 0.3));
}

TEST(BurstTest, DensityIsTheShareOfFlippedBits) {
  const auto flipped = BusyLine(100, 0.3, 50.0, 10'000);
  const auto count = static_cast<double>(std::count(flipped.begin(), flipped.end(), true));
  const double seconds = 10'000 * 68 * 10 / 921'600.0;
  EXPECT_NEAR(count, seconds * 50.0 * 100 * 0.3, 0.25 * seconds * 50.0 * 100 * 0.3);
}

TEST(BurstTest, AnIdleLineSwallowsMostOfThem) {
  // 68 bytes of every 12 ms are busy, and the burst's own length counts.
  FaultSchedule schedule =
      AtTheLine({Spec("wire.burst", {{"length_bits", 8.0}, {"density", 1.0}, {"rate_hz", 20.0}})}, 1);
  Send(schedule, 50'000);
  const double busy_s = 50'000 * 69 * 10 / 921'600.0;
  EXPECT_NEAR(static_cast<double>(schedule.ActivationCounts().at(0)), 20.0 * busy_s,
              5 * std::sqrt(20.0 * busy_s));
}

TEST(BurstTest, DoesNotDependOnHowTheLineIsCutIntoFrames) {
  const auto flips = [](std::size_t size) {
    FaultSchedule schedule =
        AtTheLine({Spec("wire.burst", {{"length_bits", 30.0}, {"density", 0.5}, {"rate_hz", 500.0}})}, 1);
    schedule.SetOrigin(kOriginAtPowerOn);
    std::vector<std::size_t> bits;
    // 18 bytes take 195312.5 ns: 36 begin on a whole nanosecond.
    for (std::size_t byte = 0; byte < 36'000; byte += size) {
      link::Chunk chunk;
      chunk.begin_ns = BootTime(link::BytesTime(921'600, static_cast<std::int64_t>(byte)));
      chunk.bytes.assign(size, 0);
      const link::Chunk before = chunk;
      std::vector<link::Chunk> chunks = {chunk};
      schedule.Filter(link::Direction::kToClient)->Apply(chunks);
      for (const std::size_t bit : FlippedBits(before, chunks.at(0))) bits.push_back(8 * byte + bit);
    }
    return bits;
  };
  const auto whole = flips(360);
  ASSERT_GT(whole.size(), 1000U);
  EXPECT_EQ(whole, flips(36));
}

}  // namespace
}  // namespace tiltproof::faults
