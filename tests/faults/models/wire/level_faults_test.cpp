// A line that breaks off or is stuck: which bytes of a frame are hit follows from their times.
#include <gtest/gtest.h>

#include "tests/faults/faulty_line.h"

namespace tiltproof::faults {
namespace {

// Frame 1 as it arrives when the fault lasts from the middle of its byte 10 to the middle of its byte 20. At
// 921600 baud a byte takes 10.85 us.
Bytes HeardOfFrameOne(FaultSpec spec) {
  spec.start_ns = FrameTime(1) + link::BytesTime(921'600, 10) + 5000;
  spec.end_ns = FrameTime(1) + link::BytesTime(921'600, 20) + 5000;
  const auto out = Send(spec, 3);
  EXPECT_EQ(CountUnchanged(out), 2);
  EXPECT_EQ(out[1].size(), 1U);
  EXPECT_EQ(out[1][0].begin_ns, Frame(1).begin_ns);
  return out[1][0].bytes;
}

// Bytes 10 to 20 of frame 1 are on the line meanwhile.
Bytes FrameOneWith(const Bytes& instead) {
  Bytes bytes = Frame(1).bytes;
  bytes.erase(bytes.begin() + 10, bytes.begin() + 21);
  bytes.insert(bytes.begin() + 10, instead.begin(), instead.end());
  return bytes;
}

TEST(BreakTest, IsHeardAsOneZero) { EXPECT_EQ(HeardOfFrameOne(Spec("wire.break")), FrameOneWith({0})); }

TEST(StuckAtTest, LowReadsZerosAndHighNothing) {
  EXPECT_EQ(HeardOfFrameOne(Spec("wire.stuck_at", {{"level", "low"}})), FrameOneWith(Bytes(11, 0)));
  EXPECT_EQ(HeardOfFrameOne(Spec("wire.stuck_at", {{"level", "high"}})), FrameOneWith({}));
}

TEST(StuckAtTest, OfAWholeFrameNothingOrZerosAreLeft) {
  const auto high = Send(Spec("wire.stuck_at", {{"level", "high"}}), 5);
  const auto low = Send(Spec("wire.stuck_at", {{"level", "low"}}), 5);
  const auto broken = Send(Spec("wire.break"), 5);
  for (std::size_t n = 0; n < 5; ++n) {
    EXPECT_TRUE(high[n].empty());
    EXPECT_EQ(low[n].at(0).bytes, Bytes(68, 0));
    EXPECT_EQ(broken[n].at(0).bytes, Bytes{0});
  }
}

}  // namespace
}  // namespace tiltproof::faults
