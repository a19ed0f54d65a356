#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/faults/goodness_of_fit.h"
#include "tests/faults/one_signal.h"

namespace tiltproof::faults {
namespace {

// Limits for n independent normal draws: 5 std / sqrt(n) for the mean, 5 std / sqrt(2 n) for the standard deviation,
// 5 / sqrt(n) for the correlation of neighbours.
TEST(NoiseTest, IsWhiteOfItsStandardDeviation) {
  constexpr int kSamples = 20'000;
  constexpr double kStd = 0.25;
  FaultSchedule schedule = AtThePlant({Spec("sensor.noise", {{"signal", "z_m"}, {"std", kStd}})}, 3);
  double sum = 0, squares = 0, neighbours = 0, before = 0;
  for (int n = 0; n < kSamples; ++n) {
    Sensors sensors{.x_m = 1.0F, .z_m = 4.0F};
    EditSensors(schedule, n * 12 * kNsPerMs, sensors);
    EXPECT_EQ(sensors.x_m, 1.0F);
    const double noise = static_cast<double>(sensors.z_m) - 4.0;
    sum += noise;
    squares += noise * noise;
    neighbours += noise * before;
    before = noise;
  }
  EXPECT_NEAR(sum / kSamples, 0, 5 * kStd / std::sqrt(kSamples));
  EXPECT_NEAR(std::sqrt(squares / kSamples), kStd, 5 * kStd / std::sqrt(2.0 * kSamples));
  EXPECT_NEAR(neighbours / squares, 0, 5 / std::sqrt(kSamples));
}

TEST(NoiseTest, IsNormal) {
  const auto heights = ReadHeights(
      Spec("sensor.noise", {{"signal", "z_m"}, {"std", 0.25}}), 100'000, [](std::int64_t) { return 0.0F; },
      8);
  std::vector<double> draws;
  for (const float height : heights) draws.push_back(static_cast<double>(height) / 0.25);
  EXPECT_LT(KolmogorovStatistic(draws, NormalCdf), kKolmogorovCritical);
}

// Each sensor has draws of its own, and the deviation that one alone has.
TEST(NoiseTest, OfAllSensorsIsThatOfEachByItself) {
  constexpr int kSamples = 4'000;
  FaultSchedule schedule = AtThePlant({Spec("sensor.noise", {{"signal", "all"}, {"std", 0.25}})}, 5);
  double x_squares = 0, w_squares = 0, products = 0;
  for (int n = 0; n < kSamples; ++n) {
    Sensors sensors{};
    EditSensors(schedule, n * 12 * kNsPerMs, sensors);
    x_squares += static_cast<double>(sensors.x_m) * static_cast<double>(sensors.x_m);
    w_squares += static_cast<double>(sensors.wz_rad_s) * static_cast<double>(sensors.wz_rad_s);
    products += static_cast<double>(sensors.x_m) * static_cast<double>(sensors.wz_rad_s);
  }
  EXPECT_NEAR(std::sqrt(x_squares / kSamples), 0.25, 5 * 0.25 / std::sqrt(2.0 * kSamples));
  EXPECT_NEAR(std::sqrt(w_squares / kSamples), 0.25, 5 * 0.25 / std::sqrt(2.0 * kSamples));
  EXPECT_NEAR(products / std::sqrt(x_squares * w_squares), 0, 5 / std::sqrt(kSamples));
}

// A model that needs the past has the past of its own sensor.
TEST(FreezeTest, OfAllSensorsHoldsEach) {
  FaultSchedule schedule = AtThePlant({Spec("sensor.freeze", {{"signal", "all"}})}, 1);
  Sensors first{.x_m = 1.0F, .z_m = 2.0F, .vz_m_s = 3.0F};
  const Sensors held = first;
  EditSensors(schedule, 0, first);
  Sensors later{.x_m = 5.0F, .z_m = 6.0F, .vz_m_s = 7.0F};
  EditSensors(schedule, 12 * kNsPerMs, later);
  EXPECT_EQ(later, held);
}

}  // namespace
}  // namespace tiltproof::faults
