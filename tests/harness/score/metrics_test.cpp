// Metrics against closed forms.
#include "harness/score/metrics.h"
#include "tests/support/control_period.h"
#include "tests/support/tiltrotor_signals.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace tiltproof::harness {
namespace {

// With an error of e_0 + e_1 t the integral of (t - onset) error from the onset to the end is a polynomial. A trapezoid of
// width h is too large by the second derivative, 2 e_1, times h^3 / 12.
TEST(Metrics, ItaeIsItsClosedFormWhereverTheOnsetLies) {
  constexpr std::size_t kRows = 501;  // 6 s
  constexpr double kAtStart_m = 0.5, kPerSecond_m_s = 0.25;
  RunLog log;
  log.trace = testing::TiltrotorTrace();
  log.hover_input = {0, 0, 0, 0};
  for (std::size_t r = 0; r < kRows; ++r) {
    const auto row = log.trace.AppendRow();
    std::fill(row.begin(), row.end(), 0.0);
    log.end_ns = static_cast<TimeNs>(r) * kControlPeriodNs;
    row[0] = ToSeconds(log.end_ns);
    row[*log.trace.Find("x_m")] = kAtStart_m + kPerSecond_m_s * row[0];
  }
  // On a row, just after one, between two, just before one, in the last period, at and after the end.
  for (const double onset_s : {0.0, 2.4, 2.401, 2.406, 2.4119, 5.9999, 6.0, 7.0}) {
    Scenario scenario;
    scenario.duration_ns = log.end_ns;
    scenario.faults.resize(1);
    scenario.faults[0].type = "wire.bit_error";
    scenario.faults[0].start_ns = FromSeconds(onset_s);
    const double length_s = std::max(6.0 - onset_s, 0.0);
    const double integral = (kAtStart_m + kPerSecond_m_s * onset_s) * std::pow(length_s, 2) / 2 +
                            kPerSecond_m_s * std::pow(length_s, 3) / 3;
    const double whole_rows = std::floor(length_s / 0.012 + 1e-6);
    const double rest_s = length_s - 0.012 * whole_rows;
    const double too_large = kPerSecond_m_s / 6 * (whole_rows * std::pow(0.012, 3) + std::pow(rest_s, 3));
    EXPECT_NEAR(ComputeMetrics(scenario, log).values.at("tracking.itae_m_s2"), integral + too_large, 1e-12)
        << onset_s;
  }
}

TEST(Metrics, TheErrorBeforeTheFaultsAndSince) {
  RunLog log;
  log.trace = testing::TiltrotorTrace();
  log.hover_input = {0, 0, 0, 0};
  for (const double error_m : {1.0, 3.0, 5.0, 7.0}) {
    const auto row = log.trace.AppendRow();
    std::fill(row.begin(), row.end(), 0.0);
    log.end_ns = static_cast<TimeNs>(log.trace.row_count() - 1) * kControlPeriodNs;
    row[0] = ToSeconds(log.end_ns);
    row[*log.trace.Find("x_m")] = error_m;
  }
  Scenario scenario;
  scenario.duration_ns = log.end_ns;
  const auto metrics = [&] { return ComputeMetrics(scenario, log).values; };
  EXPECT_FALSE(metrics().contains("tracking.rmse_since_faults_m"));
  scenario.faults.resize(2);
  for (auto& fault : scenario.faults) fault.type = "wire.bit_error";
  scenario.faults[0].start_ns = 36 * kNsPerMs;
  scenario.faults[1].start_ns = 24 * kNsPerMs;
  EXPECT_DOUBLE_EQ(metrics().at("tracking.rmse_before_faults_m"), std::sqrt((1.0 + 9) / 2));
  EXPECT_DOUBLE_EQ(metrics().at("tracking.rmse_since_faults_m"), std::sqrt((25.0 + 49) / 2));
  scenario.faults[0].start_ns = kPowerOn;
  EXPECT_FALSE(metrics().contains("tracking.rmse_before_faults_m"));
}

}  // namespace
}  // namespace tiltproof::harness
