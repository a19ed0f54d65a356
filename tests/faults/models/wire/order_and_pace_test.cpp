// Bytes that change places, frames in pieces, and a line that carries less.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/faults/faulty_line.h"
#include "tests/faults/goodness_of_fit.h"

namespace tiltproof::faults {
namespace {

TEST(ByteSwapTest, SwapsNeighboursWithItsProbability) {
  constexpr int kSent = 5000;
  constexpr double kProbability = 0.3;
  const auto out = Send(Spec("wire.byte_swap", {{"probability", kProbability}}), kSent);
  double swaps = 0, same = 0;
  for (int n = 0; n < kSent; ++n) {
    const Bytes before = Frame(n).bytes, &after = out[static_cast<std::size_t>(n)].at(0).bytes;
    ASSERT_EQ(before.size(), after.size());
    for (std::size_t i = 0; i + 1 < before.size(); ++i) same += before[i] == before[i + 1] ? 1 : 0;
    for (std::size_t i = 0; i < before.size(); ++i) {
      if (before[i] == after[i]) continue;
      ASSERT_LT(i + 1, before.size());
      ASSERT_EQ(after[i], before[i + 1]);
      ASSERT_EQ(after[i + 1], before[i]);
      ++i;
      ++swaps;
    }
  }
  // Expected swaps among k bytes: e(k) = p (1 + e(k - 2)) + (1 - p) e(k - 1). Swaps of equal bytes are not seen.
  double before_last = 0, last = 0;
  for (int k = 2; k <= 68; ++k) {
    const double next = kProbability * (1 + before_last) + (1 - kProbability) * last;
    before_last = last;
    last = next;
  }
  const double unseen = same * last / 67;
  EXPECT_NEAR(swaps, kSent * last - unseen, 6 * std::sqrt(kSent * last));
}

// A byte that has been moved is not moved again, so it draws nothing.
TEST(ByteSwapTest, EachByteIsMovedForItself) {
  const Bytes before = DistinctBytes();
  std::vector<bool> moved;
  for (const auto& chunks : SendWithoutPause(Spec("wire.byte_swap", {{"probability", 0.2}}), before, 7000)) {
    const Bytes& after = chunks.at(0).bytes;
    ASSERT_EQ(after.size(), before.size());
    for (std::size_t i = 0; i + 1 < before.size(); ++i) {
      moved.push_back(after[i] != before[i]);
      if (!moved.back()) continue;
      ASSERT_EQ(after[i], before[i + 1]);
      ASSERT_EQ(after[i + 1], before[i]);
      ++i;
    }
  }
  EXPECT_TRUE(AreBernoulli(moved, 0.2));  // some 115 000 of them
}

TEST(ChunkingTest, PiecesFollowWithTheirGap) {
  const auto out = Send(Spec("wire.chunking", {{"max_bytes_count", 20.0}, {"gap_ms", 0.5}}), 3);
  for (std::int64_t n = 0; n < 3; ++n) {
    const auto& pieces = out[static_cast<std::size_t>(n)];
    ASSERT_EQ(pieces.size(), 4U);
    Bytes joined;
    for (std::size_t i = 0; i < 4; ++i) {
      EXPECT_EQ(pieces[i].bytes.size(), i < 3 ? 20U : 8U);
      // 20 bytes take 217.01 us.
      EXPECT_NEAR(static_cast<double>(pieces[i].begin_ns - Frame(n).begin_ns),
                  static_cast<double>(i) * 717'014, 5.0);
      joined.insert(joined.end(), pieces[i].bytes.begin(), pieces[i].bytes.end());
    }
    EXPECT_EQ(joined, Frame(n).bytes);
  }
}

TEST(ChunkingTest, AFrameThatFitsGoesOn) {
  EXPECT_EQ(CountUnchanged(Send(Spec("wire.chunking", {{"max_bytes_count", 68.0}, {"gap_ms", 5.0}}), 10)),
            10);
}

// A queue in front of a server: frame n leaves at the latest of A(j) + S(j) + ... + S(n) over all j <= n, where A is
// when a frame is sent and S how long it takes.
TEST(BandwidthCapTest, IsAQueueInFrontOfASlowerLine) {
  for (const double bytes_per_s : {3000.0, 6000.0, 50'000.0, 500'000.0}) {
    const auto out = Send(Spec("wire.bandwidth_cap", {{"bytes_per_s", bytes_per_s}}), 40);
    const double service_ns = 68e9 / bytes_per_s, wire_ns = 68e10 / 921'600;
    for (std::int64_t n = 0; n < 40; ++n) {
      double leaves_ns = 0;
      for (std::int64_t j = 0; j <= n; ++j)
        leaves_ns = std::max(leaves_ns,
                             static_cast<double>(FrameTime(j)) + static_cast<double>(n - j + 1) * service_ns);
      const double begins_ns = std::max(leaves_ns - wire_ns, static_cast<double>(FrameTime(n)));
      EXPECT_NEAR(static_cast<double>(out[static_cast<std::size_t>(n)].at(0).begin_ns.ns()), begins_ns, 100.0)
          << bytes_per_s << " " << n;
    }
  }
}

}  // namespace
}  // namespace tiltproof::faults
