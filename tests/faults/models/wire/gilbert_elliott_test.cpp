#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/faults/faulty_line.h"
#include "tests/faults/goodness_of_fit.h"

namespace tiltproof::faults {
namespace {

// Sends `count` frames: true for each bit that flips, over all frames as one sequence.
std::vector<bool> Flipped(const FaultSpec& spec, std::int64_t count) {
  const auto out = Send(spec, count);
  std::vector<bool> flipped(544 * static_cast<std::size_t>(count), false);
  for (std::int64_t n = 0; n < count; ++n) {
    for (const std::size_t bit : FlippedBits(Frame(n), out[static_cast<std::size_t>(n)].at(0))) {
      flipped[544 * static_cast<std::size_t>(n) + bit] = true;
    }
  }
  return flipped;
}

// With error ratios 0 and 1 the flipped bits are the channel's states.
std::vector<bool> States(double p_bad, double p_good, std::int64_t count) {
  return Flipped(Spec("wire.gilbert_elliott",
                      {{"p_bad", p_bad}, {"p_good", p_good}, {"ber_good", 0.0}, {"ber_bad", 1.0}}),
                 count);
}

std::vector<double> RunLengths(const std::vector<bool>& states, bool of) {
  std::vector<double> lengths;
  for (std::size_t i = 0; i < states.size();) {
    std::size_t end = i;
    while (end < states.size() && states[end] == states[i]) ++end;
    if (states[i] == of) lengths.push_back(static_cast<double>(end - i));
    i = end;
  }
  return lengths;
}

double Mean(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

// A state can end after its first bit: a run of n bits is n - 1 failures to leave it.
std::vector<double> FailuresToLeave(const std::vector<bool>& states, bool state) {
  std::vector<double> failures = RunLengths(states, state);
  for (double& length : failures) --length;
  return failures;
}

TEST(GilbertElliottTest, StaysInEachStateAsLongAsItSays) {
  const auto states = States(0.02, 0.05, 13'500);
  const auto bad = FailuresToLeave(states, true);
  const auto good = FailuresToLeave(states, false);
  ASSERT_GT(bad.size(), 100'000U);
  ASSERT_GT(good.size(), 100'000U);
  EXPECT_TRUE(AreGeometric(bad, 0.05));
  EXPECT_TRUE(AreGeometric(good, 0.02));
  EXPECT_FALSE(states[0]);
}

TEST(GilbertElliottTest, ABadStateOutlastsFrames) {
  const auto bad = RunLengths(States(0.0005, 0.0005, 4000), true);
  EXPECT_GT(*std::max_element(bad.begin(), bad.end()), 2 * 544.0);
  EXPECT_NEAR(Mean(bad), 2000.0, 5 * 2000.0 / std::sqrt(static_cast<double>(bad.size())));
}

TEST(GilbertElliottTest, EachStateHasItsErrorRatio) {
  // Never bad; always bad from the second bit on.
  const auto flipped = [](double p_bad) {
    return Flipped(Spec("wire.gilbert_elliott",
                        {{"p_bad", p_bad}, {"p_good", 0.0}, {"ber_good", 0.05}, {"ber_bad", 0.2}}),
                   4000);
  };
  EXPECT_TRUE(AreBernoulli(flipped(0.0), 0.05));
  EXPECT_TRUE(AreBernoulli(flipped(1.0), 0.2));
}

}  // namespace
}  // namespace tiltproof::faults
