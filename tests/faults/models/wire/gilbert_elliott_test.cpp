#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/faults/faulty_line.h"

namespace tiltproof::faults {
namespace {

// With error ratios 0 and 1 the flipped bits are the channel's states, over all frames as one sequence.
std::vector<bool> States(double p_bad, double p_good, std::int64_t count) {
  const auto out = Send(Spec("wire.gilbert_elliott",
                             {{"p_bad", p_bad}, {"p_good", p_good}, {"ber_good", 0.0}, {"ber_bad", 1.0}}),
                        count);
  std::vector<bool> states(544 * static_cast<std::size_t>(count), false);
  for (std::int64_t n = 0; n < count; ++n) {
    for (const std::size_t bit : FlippedBits(Frame(n), out[static_cast<std::size_t>(n)].at(0))) {
      states[544 * static_cast<std::size_t>(n) + bit] = true;
    }
  }
  return states;
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

TEST(GilbertElliottTest, StaysInEachStateAsLongAsItSays) {
  const auto states = States(0.002, 0.05, 4000);
  const auto bad = RunLengths(states, true);
  const auto good = RunLengths(states, false);
  ASSERT_GT(bad.size(), 3000U);
  // A geometric length has a standard deviation of about its mean.
  EXPECT_NEAR(Mean(bad), 20.0, 5 * 20.0 / std::sqrt(static_cast<double>(bad.size())));
  EXPECT_NEAR(Mean(good), 500.0, 5 * 500.0 / std::sqrt(static_cast<double>(good.size())));
  // P(length = 1) = p_good: the state can end after its first bit.
  const auto ones = static_cast<double>(std::count(bad.begin(), bad.end(), 1.0));
  EXPECT_NEAR(ones / static_cast<double>(bad.size()), 0.05, 0.02);
  EXPECT_FALSE(states[0]);
}

TEST(GilbertElliottTest, ABadStateOutlastsFrames) {
  const auto bad = RunLengths(States(0.0005, 0.0005, 4000), true);
  EXPECT_GT(*std::max_element(bad.begin(), bad.end()), 2 * 544.0);
  EXPECT_NEAR(Mean(bad), 2000.0, 5 * 2000.0 / std::sqrt(static_cast<double>(bad.size())));
}

TEST(GilbertElliottTest, EachStateHasItsErrorRatio) {
  // Never bad; always bad from the second bit on.
  const auto count_flips = [](double p_bad) {
    const auto out = Send(Spec("wire.gilbert_elliott",
                               {{"p_bad", p_bad}, {"p_good", 0.0}, {"ber_good", 0.01}, {"ber_bad", 0.2}}),
                          1000);
    double flips = 0;
    for (std::int64_t n = 0; n < 1000; ++n) {
      flips += static_cast<double>(FlippedBits(Frame(n), out[static_cast<std::size_t>(n)].at(0)).size());
    }
    return flips / 544'000.0;
  };
  EXPECT_NEAR(count_flips(0.0), 0.01, 0.001);
  EXPECT_NEAR(count_flips(1.0), 0.2, 0.004);
}

}  // namespace
}  // namespace tiltproof::faults
