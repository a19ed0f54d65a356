#include <gtest/gtest.h>

#include "tests/faults/faulty_line.h"

namespace tiltproof::faults {
namespace {

// Byte by byte, from the definition: what of frame n is on the line outside the window.
std::vector<std::pair<BootTime, std::uint8_t>> Left(std::int64_t n, BootTime start_ns, BootTime end_ns) {
  std::vector<std::pair<BootTime, std::uint8_t>> left;
  const link::Chunk frame = Frame(n);
  for (std::int64_t i = 0; i < 68; ++i) {
    const BootTime begin = frame.begin_ns + i * 10'000'000'000 / 921'600;
    const BootTime end = frame.begin_ns + (i + 1) * 10'000'000'000 / 921'600;
    if (end <= start_ns || begin >= end_ns)
      left.emplace_back(begin, frame.bytes[static_cast<std::size_t>(i)]);
  }
  return left;
}

TEST(DisconnectTest, CutsFramesInTheMiddle) {
  constexpr TimeNs kByte = 10'851;
  const TimeNs frame = FrameTime(3);
  const std::vector<std::pair<TimeNs, TimeNs>> windows = {
      {frame + 20 * kByte, FrameTime(6) + 30 * kByte},  // opens in frame 3, closes in frame 6
      {frame + 20 * kByte, frame + 30 * kByte},         // within one frame
      {frame - 5, frame + 5},                           // its first byte alone
      {frame + 1, frame + 2},
      {frame + 67 * kByte + 100, frame + 80 * kByte},  // its last byte alone
      {frame + 1'000'000, frame + 2'000'000},          // idle line
      {frame, frame + 1'000'000},                      // one whole frame
  };
  for (const auto& [start_ns, end_ns] : windows) {
    FaultSpec spec = Spec("link.disconnect");
    spec.start_ns = start_ns;
    spec.end_ns = end_ns;
    FaultSchedule schedule = AtTheLine({spec}, 1);
    const auto out = Send(schedule, 10);
    std::int64_t cut = 0;
    for (std::int64_t n = 0; n < 10; ++n) {
      std::vector<std::pair<BootTime, std::uint8_t>> left;
      for (const auto& chunk : out[static_cast<std::size_t>(n)]) {
        for (std::size_t i = 0; i < chunk.bytes.size(); ++i) {
          left.emplace_back(chunk.begin_ns + static_cast<TimeNs>(i) * 10'000'000'000 / 921'600,
                            chunk.bytes[i]);
        }
      }
      const auto expected =
          Left(n, kOriginAtPowerOn.ToBootTime(start_ns), kOriginAtPowerOn.ToBootTime(end_ns));
      ASSERT_EQ(left.size(), expected.size()) << n;
      for (std::size_t i = 0; i < left.size(); ++i) {
        EXPECT_EQ(left[i].second, expected[i].second);
        EXPECT_NEAR(static_cast<double>(left[i].first - expected[i].first), 0, 1);
      }
      cut += expected.size() < 68 ? 1 : 0;
    }
    EXPECT_EQ(schedule.ActivationCounts().at(0), cut);
  }
}

TEST(DisconnectTest, CutsBothDirectionsUnlessTargeted) {
  FaultSpec spec = Spec("link.disconnect");
  spec.target = Target::kNone;
  FaultSchedule both = AtTheLine({spec}, 1);
  EXPECT_NE(both.Filter(link::Direction::kToClient), nullptr);
  EXPECT_NE(both.Filter(link::Direction::kToPlant), nullptr);
  spec.target = Target::kToPlant;
  FaultSchedule one = AtTheLine({spec}, 1);
  EXPECT_EQ(one.Filter(link::Direction::kToClient), nullptr);
}

TEST(DisconnectTest, OnAnIdealLineFramesAreInstants) {
  FaultSpec spec = Spec("link.disconnect");
  spec.start_ns = FrameTime(3);
  spec.end_ns = FrameTime(5);
  FaultSchedule schedule = AtTheLine({spec}, 1, {.baud = 0, .reference_baud = 0});
  const auto out = Send(schedule, 10);
  EXPECT_TRUE(out[3].empty());
  EXPECT_TRUE(out[4].empty());
  EXPECT_EQ(CountUnchanged(out), 8);
}

}  // namespace
}  // namespace tiltproof::faults
