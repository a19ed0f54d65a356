// The Dryden turbulence against the formulas of MIL-HDBK-1797, written down here apart from the model.
#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include "tests/faults/faulty_line.h"
#include "tests/faults/goodness_of_fit.h"

namespace tiltproof::faults {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kIntensity_m_s = 1.5, kSpeed_m_s = 10, kHeight_m = 10, kStep_s = 0.1;

FaultSpec Turbulent() {
  return Spec(
      "plant.turbulence",
      {{"intensity_m_s", kIntensity_m_s}, {"reference_speed_m_s", kSpeed_m_s}, {"height_m", kHeight_m}});
}

struct Axis {
  double variance, length_m;
  bool is_longitudinal;
  // One-sided, over the angular frequency in rad/s.
  double Spectrum(double omega) const {
    const double scale = variance * 2 * length_m / (kPi * kSpeed_m_s),
                 a = std::pow(length_m * omega / kSpeed_m_s, 2);
    return is_longitudinal ? scale / (1 + a) : scale * (1 + 12 * a) / std::pow(1 + 4 * a, 2);
  }
  // The spectrum of the samples: frequencies beyond half the rate of sampling fold back.
  double SampledSpectrum(double omega) const {
    double sum = Spectrum(omega);
    for (int k = 1; k < 200; ++k)
      sum += Spectrum(2 * kPi * k / kStep_s + omega) + Spectrum(2 * kPi * k / kStep_s - omega);
    return sum;
  }
};

std::array<Axis, 3> Axes() {
  const double height_ft = kHeight_m / 0.3048, base = 0.177 + 0.000823 * height_ft;
  const double lu_m = height_ft / std::pow(base, 1.2) * 0.3048;
  const double variance = kIntensity_m_s * kIntensity_m_s, horizontal = variance * std::pow(base, -0.8);
  return {{{horizontal, lu_m, true}, {horizontal, lu_m / 2, false}, {variance, kHeight_m / 2, false}}};
}

std::array<std::vector<double>, 3> Winds(int count, std::uint64_t seed) {
  FaultSchedule schedule = AtThePlant({Turbulent()}, seed);
  std::array<std::vector<double>, 3> winds;
  for (int n = 0; n < count; ++n) {
    const auto wind = schedule.DisturbanceOf(n * 100 * kNsPerMs).wind_m_s;
    for (std::size_t i = 0; i < 3; ++i) winds[i].push_back(wind[i]);
  }
  return winds;
}

// Periodograms of segments under a Hann window, averaged over the segments: 131 072 draws of each part.
TEST(TurbulenceTest, HasTheSpectraOfItsModel) {
  constexpr int kSegment = 1024, kSegments = 128;
  const auto winds = Winds(kSegment * kSegments, 11);
  std::vector<std::complex<double>> turns;
  std::vector<double> window;
  double window_power = 0;
  for (int n = 0; n < kSegment; ++n) {
    turns.push_back(std::polar(1.0, -2 * kPi * n / kSegment));
    window.push_back(0.5 - 0.5 * std::cos(2 * kPi * n / kSegment));
    window_power += window.back() * window.back();
  }
  const std::array<Axis, 3> axes = Axes();
  for (std::size_t i = 0; i < 3; ++i) {
    for (int low = 4; low < 512; low *= 2) {
      double ratio = 0;
      int count = 0;
      for (int bin = low; bin < 2 * low && bin < 500; bin += std::max(1, low / 8), ++count) {
        double power = 0;
        for (int segment = 0; segment < kSegments; ++segment) {
          std::complex<double> sum;
          for (int n = 0; n < kSegment; ++n)
            sum += window[static_cast<std::size_t>(n)] *
                   winds[i][static_cast<std::size_t>(segment * kSegment + n)] *
                   turns[static_cast<std::size_t>(n * bin % kSegment)];
          power += std::norm(sum) / kSegments;
        }
        const double omega = 2 * kPi * bin / (kSegment * kStep_s);
        ratio += power * kStep_s / (kPi * window_power) / axes[i].SampledSpectrum(omega);
      }
      // The periodograms of neighbouring bins correlate under the window, by 2/3 at most.
      EXPECT_NEAR(ratio / count, 1.0, 5 * std::sqrt(2.0 / (kSegments * count)))
          << "part " << i << ", bins from " << low;
    }
  }
}

// Another seed is another draw of the same process: at its first step, and later.
TEST(TurbulenceTest, IsNormalFromTheFirstStepOn) {
  constexpr int kSeeds = 100'000;
  std::array<std::vector<double>, 3> first, later;
  const std::array<Axis, 3> axes = Axes();
  for (int seed = 0; seed < kSeeds; ++seed) {
    const auto winds = Winds(4, static_cast<std::uint64_t>(seed));
    for (std::size_t i = 0; i < 3; ++i) {
      first[i].push_back(winds[i][0] / std::sqrt(axes[i].variance));
      later[i].push_back(winds[i][3] / std::sqrt(axes[i].variance));
    }
  }
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_LT(KolmogorovStatistic(first[i], NormalCdf), kKolmogorovCritical) << i;
    EXPECT_LT(KolmogorovStatistic(later[i], NormalCdf), kKolmogorovCritical) << i;
    // The autocorrelation after 0.3 s, from the inverse transform of the spectra.
    const double r = 0.3 * kSpeed_m_s / axes[i].length_m;
    const double expected = axes[i].is_longitudinal ? std::exp(-r) : std::exp(-r / 2) * (1 - r / 4);
    double products = 0;
    for (std::size_t n = 0; n < first[i].size(); ++n) products += first[i][n] * later[i][n];
    EXPECT_NEAR(products / kSeeds, expected, 5 / std::sqrt(kSeeds)) << i;
  }
  double crossed = 0;
  for (std::size_t n = 0; n < first[0].size(); ++n)
    crossed += first[0][n] * first[1][n] + first[1][n] * first[2][n];
  EXPECT_NEAR(crossed / kSeeds, 0, 5 * std::sqrt(2.0 / kSeeds));
}

// Sampled three times as often it is the same process: the variance of its changes tells.
TEST(TurbulenceTest, DoesNotDependOnTheStep) {
  for (const TimeNs step_ns : {2 * kNsPerMs, 12 * kNsPerMs}) {
    FaultSchedule schedule = AtThePlant({Turbulent()}, 3);
    double squares = 0, before = 0;
    constexpr int kChanges = 20'000;
    const int every = static_cast<int>(24 * kNsPerMs / step_ns);
    for (int n = 0; n <= kChanges * every; ++n) {
      const double w = schedule.DisturbanceOf(n * step_ns).wind_m_s[2];
      if (n % every != 0) continue;
      if (n > 0) squares += (w - before) * (w - before);
      before = w;
    }
    const double r = 0.024 * kSpeed_m_s / (kHeight_m / 2);
    const double expected = 2 * kIntensity_m_s * kIntensity_m_s * (1 - std::exp(-r / 2) * (1 - r / 4));
    EXPECT_NEAR(squares / kChanges / expected, 1, 5 * std::sqrt(2.0 / kChanges)) << step_ns;
  }
}

}  // namespace
}  // namespace tiltproof::faults
