// Types that draw, and proof that the judgements that compare their draws with a distribution can fail.
#include "tests/faults/goodness_of_fit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "faults/random.h"
#include "tests/faults/faulty_flight.h"

namespace tiltproof::faults {
namespace {

std::vector<bool> Draws(double p, int count) {
  Random random(17);
  std::vector<bool> draws;
  for (int i = 0; i < count; ++i) draws.push_back(random.Bernoulli(p));
  return draws;
}

TEST(GoodnessOfFitTest, AWrongShareIsSeen) {
  EXPECT_TRUE(AreBernoulli(Draws(0.2, 100'000), 0.2));
  EXPECT_FALSE(AreBernoulli(Draws(0.2, 100'000), 0.22));
  EXPECT_FALSE(AreBernoulli(Draws(0.2, 100'000), 0.18));
  EXPECT_FALSE(AreBernoulli(std::vector<bool>(100'000), 0.2));
}

TEST(GoodnessOfFitTest, DrawsThatDependOnEachOtherAreSeen) {
  std::vector<bool> twice;
  for (const bool draw : Draws(0.2, 50'000)) twice.insert(twice.end(), 2, draw);
  EXPECT_FALSE(AreBernoulli(twice, 0.2));
  std::vector<bool> every_fifth(100'000);
  for (std::size_t i = 0; i < every_fifth.size(); i += 5) every_fifth[i] = true;
  EXPECT_FALSE(AreBernoulli(every_fifth, 0.2));
}

TEST(GoodnessOfFitTest, AValueThatIsMissingIsSeen) {
  const auto counts = [](std::uint64_t values) {
    Random random(18);
    std::vector<double> by_value(256);
    for (int i = 0; i < 100'000; ++i) ++by_value[random.Below(values)];
    return by_value;
  };
  EXPECT_TRUE(AreUniform(counts(256)));
  EXPECT_FALSE(AreUniform(counts(255)));
}

TEST(GoodnessOfFitTest, AnotherDistributionIsSeen) {
  Random random(19);
  std::vector<double> draws;
  for (int i = 0; i < 100'000; ++i) draws.push_back(random.StandardNormal());
  EXPECT_TRUE(HaveCdf(draws, NormalCdf));
  EXPECT_FALSE(HaveCdf(draws, [](double x) { return NormalCdf(x - 0.02); }));
  EXPECT_FALSE(HaveCdf(draws, [](double x) { return NormalCdf(x / 1.02); }));
}

// Abramowitz and Stegun, Handbook of Mathematical Functions, table 26.8.
TEST(GoodnessOfFitTest, CriticalValuesAreThoseOfTheTable) {
  EXPECT_NEAR(ChiSquareCritical(1), 10.83, 0.4);
  EXPECT_NEAR(ChiSquareCritical(5), 20.52, 0.3);
  EXPECT_NEAR(ChiSquareCritical(30), 59.70, 0.3);
  EXPECT_NEAR(ChiSquareCritical(100), 149.45, 0.3);
}

// Each of these has a test of 100 000 draws or more against its distribution, beside its other tests. So have the
// types that draw elsewhere: uart.* (receiver_test.cpp) and device.bit_flip (device_command_test.cpp).
TEST(GoodnessOfFitTest, TheseTypesDraw) {
  std::vector<std::string> drawing;
  for (const FaultType& type : FaultTypes()) {
    const std::uint64_t before = Random::DrawnCount();
    Fly({ExampleSpec(type)});
    if (Random::DrawnCount() != before) drawing.emplace_back(type.name);
  }
  EXPECT_THAT(
      drawing,
      ::testing::UnorderedElementsAre(
          "wire.bit_error", "wire.gilbert_elliott", "wire.burst", "wire.stuck_byte", "wire.byte_drop",
          "wire.byte_insert", "wire.byte_duplicate", "wire.byte_swap", "wire.echo", "frame.drop",
          "frame.duplicate", "frame.reorder", "frame.delay", "frame.truncate", "frame.length_error",
          "frame.replay_stale", "frame.short", "frame.long", "frame.wrong_id", "frame.semantic",
          "frame.checksum_preserving", "frame.flag_loss", "frame.flag_forgery", "frame.dangling_escape",
          "frame.unsolicited", "frame.babble", "sensor.noise", "sensor.random_walk", "sensor.dropout",
          "sensor.spike", "sensor.garbage", "actuator.noise", "plant.turbulence"));
}

}  // namespace
}  // namespace tiltproof::faults
