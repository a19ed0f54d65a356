#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/faults/goodness_of_fit.h"
#include "tests/faults/one_signal.h"

namespace tiltproof::faults {
namespace {

TEST(ActuatorNoiseTest, IsNormalAndWhite) {
  constexpr double kStd = 0.4;
  const auto thrusts = RightThrusts(
      Spec("actuator.noise", {{"actuator", "f_r"}, {"std", kStd}}), 100'000,
      [](std::int64_t) { return 10.0; }, 9);
  std::vector<double> draws;
  for (const double thrust : thrusts) draws.push_back((thrust - 10) / kStd);
  EXPECT_LT(KolmogorovStatistic(draws, NormalCdf), kKolmogorovCritical);
  EXPECT_LT(std::abs(CorrelationOfNeighbours(draws)), 4 / std::sqrt(draws.size()));
}

}  // namespace
}  // namespace tiltproof::faults
