// The equations of motion against Lagrange's, and the hover and linear model that come from them.
#include "plant/dynamics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/plant/models.h"
#include "tests/support/lagrange_model.h"
#include "tests/support/tiltrotor_plant.h"

namespace tiltproof::plant {
namespace {

using testing::LagrangeModel;
using testing::LagrangeParameters;

struct MotionCase {
  const char* model;
  LagrangeParameters (*parameters)();
};
class EveryModel : public ::testing::TestWithParam<MotionCase> {};
INSTANTIATE_TEST_SUITE_P(Dynamics, EveryModel,
                         ::testing::Values(MotionCase{"tiltrotor", &testing::DesignPlant},
                                           MotionCase{"tiltrotor_published", &testing::PublishedPlant}),
                         [](const auto& test) { return std::string(test.param.model); });

TEST_P(EveryModel, AccelerationIsLagranges) {
  const VehicleModel model = LoadShipped(GetParam().model);
  const LagrangeModel lagrange(GetParam().parameters());
  std::mt19937_64 generator(1);
  for (int i = 0; i < 200; ++i) {
    Coordinates<double> q(8), q_dot(8);
    for (int j = 0; j < 8; ++j) {
      q[j] = Draw(generator, j == 4 ? 1.2 : 3.0);
      q_dot[j] = Draw(generator, 5.0);
    }
    const ActuatorsTruth u = {Draw(generator, 20), Draw(generator, 20), Draw(generator, 1),
                              Draw(generator, 1)};
    const Coordinates<double> ours = Acceleration(model, q.cast<Complex>(), q_dot.cast<Complex>(),
                                                  Eigen::Vector4cd(u.f_r_n, u.f_l_n, u.tau_r_nm, u.tau_l_nm))
                                         .real();
    const Coordinates<double> theirs = lagrange.Acceleration(q, q_dot, u);
    EXPECT_LT((ours - theirs).norm(), 1e-7 * (1 + theirs.norm())) << "q = " << q.transpose();
  }
}

TEST_P(EveryModel, HoverStandsStill) {
  const VehicleModel model = LoadShipped(GetParam().model);
  const LagrangeModel lagrange(GetParam().parameters());
  EXPECT_LT(lagrange
                .Acceleration(HoverCoordinates(model.hover), LagrangeModel::Vector8::Zero(),
                              testing::ActuatorsOf(model.HoverInput()))
                .cwiseAbs()
                .maxCoeff(),
            1e-6);
}

TEST_P(EveryModel, LinearModelIsTheDerivative) {
  const VehicleModel model = LoadShipped(GetParam().model);
  const LagrangeModel lagrange(GetParam().parameters());
  const LinearModel linear = Linearise(model, model.hover);
  const Coordinates<double> q = HoverCoordinates(model.hover), zero = Coordinates<double>::Zero(8);
  const Inputs<double> u = HoverInputs(model.hover);
  const auto acceleration = [&](const Coordinates<double>& at, const Coordinates<double>& speed,
                                const Inputs<double>& input) {
    return lagrange.Acceleration(at, speed, {input[0], input[1], input[2], input[3]});
  };
  constexpr double h = 1e-5;
  const auto close = [](const auto& exact, const auto& difference) {
    return (exact - difference).cwiseAbs().maxCoeff() < 1e-5 * (1 + difference.cwiseAbs().maxCoeff());
  };
  for (int i = 0; i < 8; ++i) {
    const Coordinates<double> d = h * Coordinates<double>::Unit(8, i);
    EXPECT_TRUE(close(linear.a.col(i).tail<8>(),
                      (acceleration(q + d, zero, u) - acceleration(q - d, zero, u)) / (2 * h)));
    EXPECT_TRUE(
        close(linear.a.col(8 + i).tail<8>(), (acceleration(q, d, u) - acceleration(q, -d, u)) / (2 * h)));
  }
  for (int i = 0; i < 4; ++i) {
    const Inputs<double> d = h * Inputs<double>::Unit(4, i);
    EXPECT_TRUE(close(linear.b.col(i).tail<8>(),
                      (acceleration(q, zero, u + d) - acceleration(q, zero, u - d)) / (2 * h)));
  }
  EXPECT_EQ((linear.a.topRows<8>().rightCols<8>()), (Eigen::Matrix<double, 8, 8>::Identity()));
}

TEST(Hover, OfTheDesignPlant) {
  const Hover hover = SolveHover(LoadShipped("tiltrotor"));
  EXPECT_NEAR(hover.roll_rad, -3.9e-5, 1e-6);
  EXPECT_NEAR(hover.pitch_rad, -0.011689, 1e-6);
  EXPECT_NEAR(hover.hinge_rad.at(0), 0.011673, 1e-6);
  EXPECT_NEAR(hover.hinge_rad.at(1), 0.011615, 1e-6);
  EXPECT_NEAR(hover.input.at(0), 10.27118, 1e-5);
  EXPECT_NEAR(hover.input.at(1), 10.28035, 1e-5);
  EXPECT_NEAR(hover.input.at(2), 0, 1e-12);
  EXPECT_NEAR(hover.input.at(3), 0, 1e-12);
}

// The judge judged: nothing may gain or lose energy in a tumble without inputs, and a shorter step must not
// matter.
TEST(LagrangeModel, ConservesEnergy) {
  for (const LagrangeParameters& parameters : {testing::DesignPlant(), testing::PublishedPlant()}) {
    const LagrangeModel model(parameters);
    LagrangeModel::State state;
    state.q << 0, 0, 5, 0.1, 0.2, 0.3, 0.4, -0.5;
    state.q_dot << 1, 2, 3, 1.0, -0.7, 0.9, 2, -3;
    const double before = model.Energy(state);
    LagrangeModel::State fine = state;
    for (int i = 0; i < 500; ++i) model.Advance({}, 1e-3, state);
    for (int i = 0; i < 2000; ++i) model.Advance({}, 0.25e-3, fine);
    EXPECT_NEAR(model.Energy(state), before, 1e-8);
    EXPECT_LT((state.q - fine.q).norm(), 1e-8);
  }
}

}  // namespace
}  // namespace tiltproof::plant
