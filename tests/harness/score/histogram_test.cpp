// Bins that any two flights share.
#include "harness/score/histogram.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

namespace tiltproof::harness {
namespace {

TEST(Histograms, ABinHoldsItsLowerEdgeAndNotItsUpperOne) {
  const Histogram none = RequestPeriodHistogram({}, 12 * kNsPerMs);
  EXPECT_EQ(none.edges.size(), 41u);
  EXPECT_EQ(none.edges.front(), 10.0);
  EXPECT_EQ(none.edges[1], 10.1);
  EXPECT_EQ(none.edges[20], 12.0);
  EXPECT_EQ(none.edges.back(), 14.0);
  EXPECT_EQ(none.counts, std::vector<std::int64_t>(42, 0));
  EXPECT_EQ(RequestPeriodHistogram(std::vector<TimeNs>{77}, 12 * kNsPerMs), none);
  // The bin of a period p is edge i-1 <= p < edge i; first and last take what lies outside.
  const auto bin_of = [&](TimeNs period_ns) {
    const Histogram histogram =
        RequestPeriodHistogram(std::vector<TimeNs>{-500, -500 + period_ns}, 12 * kNsPerMs);
    EXPECT_EQ(std::count(histogram.counts.begin(), histogram.counts.end(), 0), 41);
    return std::find(histogram.counts.begin(), histogram.counts.end(), 1) - histogram.counts.begin();
  };
  EXPECT_EQ(bin_of(0), 0);
  EXPECT_EQ(bin_of(9'999'999), 0);
  EXPECT_EQ(bin_of(10'000'000), 1);
  EXPECT_EQ(bin_of(11'999'999), 20);
  EXPECT_EQ(bin_of(12'000'000), 21);
  EXPECT_EQ(bin_of(13'999'999), 40);
  EXPECT_EQ(bin_of(14'000'000), 41);
  EXPECT_EQ(bin_of(3600 * kNsPerS), 41);
  const Histogram latencies =
      ReplyLatencyHistogram(std::vector<TimeNs>{0, 249'999, 250'000, 12'000'000}, 12 * kNsPerMs);
  EXPECT_EQ(latencies.edges.back(), 12.0);
  EXPECT_EQ(latencies.counts[1], 2);
  EXPECT_EQ(latencies.counts[2], 1);
  EXPECT_EQ(latencies.counts.back(), 1);
}

TEST(Histograms, FollowTheControlPeriod) {
  const Histogram periods = RequestPeriodHistogram(std::vector<TimeNs>{0, 4'000'000}, 4 * kNsPerMs);
  EXPECT_EQ(periods.edges.size(), 41u);
  EXPECT_NEAR(periods.edges.front(), 4.0 * 5 / 6, 1e-4);
  EXPECT_EQ(periods.edges[20], 4.0);
  EXPECT_NEAR(periods.edges.back(), 4.0 * 7 / 6, 1e-4);
  EXPECT_EQ(periods.counts[21], 1);
  const Histogram latencies = ReplyLatencyHistogram(std::vector<TimeNs>{3'999'000}, 4 * kNsPerMs);
  EXPECT_NEAR(latencies.edges.back(), 4.0, 1e-4);
  EXPECT_EQ(latencies.counts[48], 1);
}

}  // namespace
}  // namespace tiltproof::harness
