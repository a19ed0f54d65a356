// The controller design: the authors' gain comes out, and the stability figures agree with flights of the
// second model.
#include "plant/lqr_design.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <fstream>
#include <numbers>
#include <sstream>

#include "tests/plant/models.h"
#include "tests/support/lagrange_model.h"
#include "tests/support/reference_controller.h"
#include "tests/support/tiltrotor_plant.h"

namespace tiltproof::plant {
namespace {

using ::testing::HasSubstr;

GainMatrix Published() {
  const auto rows = testing::ReadGainCsv(SourceFile("tests/golden/dlqr_gain_published.csv"));
  GainMatrix gain(4, 20);
  for (int i = 0; i < gain.rows(); ++i) {
    for (int j = 0; j < gain.cols(); ++j)
      gain(i, j) = rows[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
  }
  return gain;
}

double RelativeErrorMax(const GainMatrix& gain, const GainMatrix& reference) {
  return ((gain - reference).array() / reference.array()).cwiseAbs().maxCoeff();
}

TEST(LqrDesign, ReproducesThePublishedGain) {
  const LqrDesign design = DesignLqr(LoadShipped("tiltrotor"));
  EXPECT_LT(RelativeErrorMax(design.gain, Published()), 2e-3);
  EXPECT_LT(design.dare_residual, 1e-12);
  EXPECT_LT(design.spectral_radius, 0.995);
  EXPECT_NEAR(design.delay_margin_s, 9e-3, 0.1e-3);
}

TEST(LqrDesign, WeightsAsPrintedGiveAnotherGain) {
  const VehicleModel model = LoadShipped("tiltrotor");
  LqrWeights weights = PaperWeights(model);
  weights.r << std::sqrt(0.2), std::sqrt(0.2), std::sqrt(0.05), std::sqrt(0.05);
  weights.q[14] = weights.q[15] = 5 / (9 * std::numbers::pi * std::numbers::pi);
  EXPECT_GT(RelativeErrorMax(DesignLqr(model, {.weights = weights}).gain, Published()), 5);
  weights.r.conservativeResize(3);
  EXPECT_THROW(DesignLqr(model, {.weights = weights}), DesignError);
}

TEST(LqrDesign, OfTheAsPublishedPlant) {
  const VehicleModel model = LoadShipped("tiltrotor_published");
  const LqrDesign design = DesignLqr(model);
  EXPECT_LT(design.dare_residual, 1e-12);
  EXPECT_LT(design.spectral_radius, 0.995);
  EXPECT_GT(design.delay_margin_s, 9e-3);
  // The gain published for the other plant does not hold this one.
  EXPECT_GT(ClosedLoopSpectralRadius(design.model, Published()), 1);
  EXPECT_LT(DelayMargin(design.model, Published()), 0);
}

TEST(LqrDesign, OptimalGainIsStationary) {
  // The cost from a state is x'Px; no small change of the gain lowers it.
  const VehicleModel model = LoadShipped("tiltrotor");
  const LqrWeights weights = PaperWeights(model);
  const LqrDesign design = DesignLqr(model);
  const auto cost = [&](const GainMatrix& gain) {
    Eigen::Matrix<double, 20, 1> x = Eigen::Matrix<double, 20, 1>::Zero();
    x[0] = 1;
    x[1] = -0.5;
    x[3] = 0.1;
    double sum = 0;
    for (int k = 0; k < 6000; ++k) {
      const Eigen::Vector4d u = -gain * x;
      sum += x.dot(weights.q.asDiagonal() * x) + u.dot(weights.r.asDiagonal() * u);
      Eigen::Matrix<double, 16, 1> next = design.model.a * x.head<16>() + design.model.b * u;
      for (int i = 0; i < 4; ++i) x[16 + i] += 0.006 * (x[i == 3 ? 5 : i] + next[i == 3 ? 5 : i]);
      x.head<16>() = next;
    }
    return sum;
  };
  const double best = cost(design.gain);
  for (int j = 0; j < 20; j += 3) {
    for (int i = 0; i < 4; ++i) {
      for (const double change : {0.99, 1.01}) {
        GainMatrix other = design.gain;
        other(i, j) *= change;
        EXPECT_GT(cost(other), best * (1 - 1e-12)) << i << ", " << j;
      }
    }
  }
}

TEST(ClosedLoop, WholePeriodsOfDelayAgreeWithShiftedInputs) {
  // One whole period of delay is u(k-1) in place of u(k): built here by hand.
  const LqrDesign design = DesignLqr(LoadShipped("tiltrotor"));
  Eigen::Matrix<double, 24, 24> loop = Eigen::Matrix<double, 24, 24>::Zero();
  loop.topLeftCorner<16, 16>() = design.model.a;
  loop.topRightCorner<16, 4>() = design.model.b;
  for (int i = 0; i < 4; ++i) {
    const int state = i == 3 ? 5 : i;
    loop.row(16 + i) = 0.006 * loop.row(state);
    loop(16 + i, state) += 0.006;
    loop(16 + i, 16 + i) += 1;
  }
  loop.bottomLeftCorner<4, 20>() = -design.gain;
  const double radius =
      Eigen::EigenSolver<Eigen::Matrix<double, 24, 24>>(loop).eigenvalues().cwiseAbs().maxCoeff();
  EXPECT_NEAR(ClosedLoopSpectralRadius(design.model, design.gain, 0.012), radius, 1e-9);
  EXPECT_GT(radius, 1);
  // The radius is continuous across the period.
  EXPECT_NEAR(ClosedLoopSpectralRadius(design.model, design.gain, 0.012 - 1e-9), radius, 1e-5);
}

// Small deviation from hover, flown by the second model with its input delayed: how much larger it is after 3
// s.
double GrowthWithDelay(double delay_s) {
  const testing::LagrangeModel model(testing::DesignPlant());
  const Hover hover = SolveHover(LoadShipped("tiltrotor"));
  testing::ReferenceController controller(
      testing::ReadGainCsv(SourceFile("tests/golden/dlqr_gain_published.csv")),
      testing::ActuatorsOf(hover.input));
  testing::LagrangeModel::State state;
  state.q = HoverCoordinates(hover);
  state.q[3] += 1e-6;
  ActuatorsTruth in_force = testing::ActuatorsOf(hover.input);
  double early = 0, late = 0;
  for (int k = 0; k < 500; ++k) {
    SensorsTruth sensed = testing::ToSensors(state);
    // The law regulates to zero attitude; make the hover's its origin.
    sensed.roll_rad -= hover.roll_rad;
    sensed.pitch_rad -= hover.pitch_rad;
    sensed.alpha_r_rad -= hover.hinge_rad[0];
    sensed.alpha_l_rad -= hover.hinge_rad[1];
    const double size = std::abs(sensed.alpha_r_rad) + std::abs(sensed.alpha_l_rad);
    if (k < 50) early = std::max(early, size);
    if (k >= 450) late = std::max(late, size);
    const ActuatorsTruth u = controller.Step(sensed, {});
    for (const double span_s : {delay_s, 0.012 - delay_s}) {
      for (int i = 0; i < 4; ++i) model.Advance(in_force, span_s / 4, state);
      in_force = u;
    }
  }
  return late / early;
}

TEST(DelayMargin, AgreesWithFlight) {
  const LqrDesign design = DesignLqr(LoadShipped("tiltrotor"));
  EXPECT_LT(GrowthWithDelay(design.delay_margin_s - 0.5e-3), 0.5);
  EXPECT_GT(GrowthWithDelay(design.delay_margin_s + 0.5e-3), 2);
}

TEST(GainCsv, ReadsBackTheSameNumbers) {
  GainMatrix gain = DesignLqr(LoadShipped("tiltrotor")).gain;
  gain(0, 0) = -0.0;
  gain(1, 2) = 5e-324;
  gain(2, 3) = 1;
  const auto file =
      std::filesystem::temp_directory_path() / ("tiltproof-gain-" + std::to_string(::getpid()) + ".csv");
  WriteGainCsv(file, gain);
  std::ifstream in(file);
  std::string line;
  for (int i = 0; i < 4; ++i) {
    ASSERT_TRUE(std::getline(in, line));
    std::istringstream fields(line);
    std::string number;
    for (int j = 0; j < 20; ++j) {
      ASSERT_TRUE(std::getline(fields, number, ','));
      EXPECT_EQ(std::strtod(number.c_str(), nullptr), gain(i, j));
    }
    EXPECT_FALSE(std::getline(fields, number, ','));
  }
  EXPECT_FALSE(std::getline(in, line));
  std::filesystem::remove(file);
  EXPECT_THROW(WriteGainCsv("/nonexistent/gain.csv", gain), std::runtime_error);
}

TEST(FirmwareGainTable, IsCodeWithTheNearestFloats) {
  GainMatrix gain = Published();
  gain(3, 19) = 2;
  const std::string table = FirmwareGainTable(gain, "kSomeGain");
  EXPECT_THAT(table, HasSubstr("inline constexpr Gain kSomeGain = {{\n    {{-0.000509474019F, 1.38100195F"));
  EXPECT_THAT(table, HasSubstr(", 2.0F}},\n}};\n"));
  // Every literal reads back as the nearest binary32.
  std::size_t at = 0, count = 0;
  while ((at = table.find_first_of("-0123456789", at)) != std::string::npos) {
    std::size_t used = 0;
    const float value = std::stof(table.substr(at), &used);
    ASSERT_LT(count, 80U);
    EXPECT_EQ(value, static_cast<float>(gain(static_cast<int>(count / 20), static_cast<int>(count % 20))));
    at += used;
    EXPECT_EQ(table[at], 'F');
    ++count;
  }
  EXPECT_EQ(count, 80U);
}

}  // namespace
}  // namespace tiltproof::plant
