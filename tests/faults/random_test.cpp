#include "faults/random.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <boost/random/normal_distribution.hpp>
#include <cmath>
#include <vector>

#include "faults/poisson.h"
#include "tests/faults/goodness_of_fit.h"

namespace tiltproof::faults {
namespace {

using ::testing::DoubleNear;

TEST(RandomTest, IsSplitMix64) {
  // The published generator's first numbers from 1234567.
  Random random(1234567);
  EXPECT_EQ(random(), 6457827717110365317ULL);
  EXPECT_EQ(random(), 3203168211198807973ULL);
  EXPECT_EQ(random(), 9817491932198370423ULL);
}

TEST(RandomTest, StreamsGoByFnv1a) {
  // Published FNV-1a of the empty string, continued over eight zero bytes by hand.
  std::uint64_t hash = 0xcbf29ce484222325ULL;
  for (int i = 0; i < 8; ++i) hash *= 0x100000001b3ULL;
  EXPECT_EQ(StreamKey(0, {}), hash);
  EXPECT_EQ(StreamKey(0, {"a"}), ((hash ^ 'a') * 0x100000001b3ULL) * 0x100000001b3ULL);
}

TEST(RandomTest, EveryPartOfTheNameMatters) {
  const std::vector<std::uint64_t> keys = {StreamKey(1, {"a", "b"}), StreamKey(2, {"a", "b"}),
                                           StreamKey(1, {"ab", ""}), StreamKey(1, {"", "ab"}),
                                           StreamKey(1, {"a", "c"}), StreamKey(1, {"a"})};
  for (std::size_t i = 0; i < keys.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) EXPECT_NE(keys[i], keys[j]) << i << " " << j;
  }
}

TEST(RandomTest, BernoulliHasItsFrequency) {
  for (const double p : {0.001, 0.3, 0.999}) {
    int count = 0;
    // The first number of many generators, as faults use them.
    for (std::uint64_t n = 0; n < 1'000'000; ++n) count += Random(KeyOf(7, n)).Bernoulli(p) ? 1 : 0;
    EXPECT_NEAR(count, 1e6 * p, 5 * std::sqrt(1e6 * p * (1 - p))) << p;
  }
  Random random(1);
  for (int i = 0; i < 1000; ++i) {
    EXPECT_FALSE(random.Bernoulli(0.0));
    EXPECT_TRUE(random.Bernoulli(1.0));
    EXPECT_FALSE(random.Bernoulli(std::nan("")));
  }
}

TEST(RandomTest, BelowGivesEveryValueAlike) {
  Random random(3);
  std::array<int, 7> counts{};
  for (int i = 0; i < 700'000; ++i) ++counts.at(random.Below(7));
  for (const int count : counts) EXPECT_NEAR(count, 100'000, 1500);
  EXPECT_EQ(random.Below(1), 0U);
}

TEST(RandomTest, BelowRefusesTheIncompleteRun) {
  // A run of 2^63 + 2^62 values fits once into 2^64 values. The rest, a quarter, would favour small results.
  const std::uint64_t n = 3ULL << 62;
  Random random(4);
  int high = 0;
  for (int i = 0; i < 30'000; ++i) high += random.Below(n) >= n / 3 * 2 ? 1 : 0;
  EXPECT_NEAR(high, 10'000, 500);
}

TEST(RandomTest, FailuresBeforeIsGeometric) {
  Random random(5);
  for (const double p : {1e-4, 0.1, 0.9}) {
    std::vector<double> failures;
    for (int i = 0; i < 100'000; ++i) failures.push_back(static_cast<double>(random.FailuresBefore(p)));
    EXPECT_TRUE(AreGeometric(failures, p)) << p;
  }
  EXPECT_EQ(random.FailuresBefore(0.0), Random::kManyFailures);
  EXPECT_EQ(random.FailuresBefore(1e-300), Random::kManyFailures);
  EXPECT_EQ(random.FailuresBefore(1.0), 0U);
}

TEST(RandomTest, NormalAndExponentialHaveTheirMoments) {
  double sum = 0, squares = 0;
  std::vector<double> exponential;
  for (std::uint64_t n = 0; n < 200'000; ++n) {
    Random random(KeyOf(9, n));
    const double x = random.StandardNormal();
    sum += x;
    squares += x * x;
    exponential.push_back(random.Exponential());
  }
  EXPECT_THAT(sum / 2e5, DoubleNear(0.0, 0.015));
  EXPECT_THAT(squares / 2e5, DoubleNear(1.0, 0.02));
  EXPECT_TRUE(HaveCdf(exponential, [](double x) { return 1 - std::exp(-x); }));
}

// Two million draws: several hundred of them from the tail, tens of thousands beside a layer's edge.
TEST(RandomTest, NormalIsThatOfBoost) {
  int beyond_layers = 0;
  for (std::uint64_t n = 0; n < 2'000'000; ++n) {
    Random ours(KeyOf(10, n)), theirs = ours;
    const double x = ours.StandardNormal();
    ASSERT_EQ(x, boost::random::normal_distribution<double>()(theirs)) << n;
    ASSERT_EQ(ours(), theirs()) << n << ": took another number of draws";
    if (std::abs(x) > 3.4426198558966521214) ++beyond_layers;
  }
  EXPECT_NEAR(beyond_layers, 2e6 * std::erfc(3.4426198558966521214 / std::sqrt(2.0)), 120);
}

std::vector<BootTime> Times(PoissonEvents& process, BootTime from, BootTime to) {
  std::vector<PoissonEvents::Event> events;
  process.In(from, to, events);
  std::vector<BootTime> times;
  for (const auto& event : events) times.push_back(event.time_ns);
  return times;
}

TEST(PoissonTest, HasItsRateAndVariance) {
  PoissonEvents process(50.0, 11);
  double sum = 0, squares = 0;
  for (std::int64_t second = 0; second < 4000; ++second) {
    const BootTime begin(second * kNsPerS + 500'000'000);
    const auto count = static_cast<double>(Times(process, begin, begin + kNsPerS).size());
    sum += count;
    squares += count * count;
  }
  const double mean = sum / 4000;
  EXPECT_NEAR(mean, 50.0, 0.6);
  EXPECT_NEAR(squares / 4000 - mean * mean, 50.0, 6.0);
}

TEST(PoissonTest, TimesBetweenEventsAreExponential) {
  constexpr double kRate_hz = 100;
  PoissonEvents process(kRate_hz, 13);
  std::vector<double> pauses_s;
  BootTime before;
  for (std::int64_t second = 0; second < 1100; ++second) {
    const BootTime begin(second * kNsPerS);
    for (const BootTime time : Times(process, begin, begin + kNsPerS)) {
      pauses_s.push_back(ToSeconds(time - before));
      before = time;
    }
  }
  ASSERT_GT(pauses_s.size(), 100'000U);
  EXPECT_TRUE(HaveCdf(pauses_s, [](double pause_s) { return 1 - std::exp(-kRate_hz * pause_s); }));
}

TEST(PoissonTest, DoesNotDependOnTheQuestions) {
  PoissonEvents whole(200.0, 12);
  const std::vector<BootTime> all = Times(whole, BootTime(), BootTime(5 * kNsPerS));
  ASSERT_GT(all.size(), 800U);
  PoissonEvents pieces(200.0, 12);
  std::vector<BootTime> joined;
  constexpr BootTime kEnd(5 * kNsPerS);
  for (BootTime t; t < kEnd; t += 7 * kNsPerMs) {
    const auto part = Times(pieces, t, std::min(t + 7 * kNsPerMs, kEnd));
    joined.insert(joined.end(), part.begin(), part.end());
    const BootTime past(t.ns() / 2);
    Times(pieces, past, past + kNsPerS);  // questions about the past change nothing
  }
  EXPECT_EQ(joined, all);
  EXPECT_TRUE(std::is_sorted(all.begin(), all.end()));
  EXPECT_TRUE(Times(pieces, BootTime(-kNsPerS), BootTime()).empty());
  PoissonEvents never(0.0, 12);
  EXPECT_TRUE(Times(never, BootTime(), BootTime(kNsPerS)).empty());
}

}  // namespace
}  // namespace tiltproof::faults
