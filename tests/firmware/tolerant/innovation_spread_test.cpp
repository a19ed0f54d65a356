// Where the thresholds of `tolerant` come from: how far samples are from their predictions on the vehicles and with the
// noise that it must tell from faults. docs/tolerant.md has the figures.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "firmware/tolerant/innovation.h"
#include "firmware/tolerant/lag_estimator.h"
#include "tests/firmware/tolerant/actuator_flight.h"

namespace tiltproof::firmware {
namespace {

// Over all samples but those of the first second, in which the average begins.
struct Spread {
  std::array<double, kSensorCount> square{};  // of difference / spread, summed
  double misfit_sum = 0, misfit_max = 0;
  double average_misfit_max = 0;  // over some 20 samples, as the estimator averages
  std::size_t count = 0, surprise_count = 0;

  double Rms(std::size_t signal) const { return std::sqrt(square[signal] / static_cast<double>(count)); }
  double MeanMisfit() const { return misfit_sum / static_cast<double>(count); }
};

void Add(Spread& spread, FlightPlan plan) {
  double average = 0;
  int seen = 0;
  plan.observe = [&](const MotionState& sample, const MotionState& predicted, const MotionState& before) {
    const double misfit = Misfit(sample, predicted, before);
    const bool surprise =
        misfit > LagEstimator::kSurprise * std::max<double>(average, LagEstimator::kFitMisfit);
    average += (1 - LagEstimator::kModelFading) * (misfit - average);
    if (++seen < 83) return;
    const Innovation difference = Compare(sample, predicted);
    const Innovation variance = ExpectedVariance(sample, before);
    for (std::size_t i = 0; i < kSensorCount; ++i)
      spread.square[i] += static_cast<double>(difference[i]) * difference[i] / variance[i];
    spread.misfit_sum += misfit;
    spread.misfit_max = std::max(spread.misfit_max, misfit);
    spread.average_misfit_max = std::max(spread.average_misfit_max, average);
    spread.surprise_count += surprise ? 1 : 0;
    ++spread.count;
  };
  Fly(plan);
}

// A vehicle that is by so much of 2 %, 10 % and 20 % another one, on three paths.
Spread Of(double share, bool noise) {
  Spread spread;
  for (const FlightPlan& path :
       {FlightPlan{.spiral = true}, FlightPlan{.spiral = false}, FlightPlan{.jumps_from_s = 5}}) {
    FlightPlan plan = path;
    plan.duration_s = 20;
    plan.mass = 1 + 0.02 * share;
    plan.inertia = 1 + 0.1 * share;
    plan.drag_torque = 1 + 0.2 * share;
    plan.noise = noise;
    Add(spread, plan);
  }
  return spread;
}

constexpr std::array kShares = {0.0, 1.0, -1.0};

TEST(InnovationSpread, OtherVehiclesFit) {
  for (const double share : kShares) {
    const Spread spread = Of(share, false);
    EXPECT_LT(spread.average_misfit_max, LagEstimator::kFitMisfit) << share;
    EXPECT_LT(spread.misfit_max, LagEstimator::kNoiseMisfit) << share;
    for (std::size_t i = 0; i < kSensorCount; ++i) EXPECT_LT(spread.Rms(i), 0.5) << share << ' ' << i;
  }
}

// With noise on all signals each is about a spread away, so that the misfit is that of the expected noise. Half of what
// gives the model up is left for faults, and a third of what is called lost.
TEST(InnovationSpread, NoiseIsWhatIsExpected) {
  for (const double share : kShares) {
    const Spread spread = Of(share, true);
    for (std::size_t i = 0; i < kSensorCount; ++i) {
      EXPECT_GT(spread.Rms(i), 0.2) << share << ' ' << i;
      EXPECT_LT(spread.Rms(i), 3) << share << ' ' << i;
    }
    EXPECT_GT(spread.MeanMisfit(), LagEstimator::kNoiseMisfit) << share;
    EXPECT_LT(spread.MeanMisfit(), 1.5 * LagEstimator::kNoiseMisfit) << share;
    EXPECT_LT(spread.average_misfit_max, LagEstimator::kModelMisfitMax / 2) << share;
    EXPECT_LT(spread.misfit_max, kMisfitMax / 2) << share;
    EXPECT_LT(1000 * spread.surprise_count, spread.count) << share;
  }
}

}  // namespace
}  // namespace tiltproof::firmware
