// The prediction against the plant's equations of motion, which are derived in another way, and its derivatives against
// finite differences.
#include "firmware/examples/nmpc/dynamics.h"

#include <gtest/gtest.h>

#include <random>
#include <string>

#include "tests/firmware/nmpc/vehicles.h"

namespace tiltproof::nmpc {
namespace {

template <int kHinges, int kRotors>
struct Case {
  using Size = Sizes<kHinges, kRotors>;
  static constexpr int kV = 6 + kHinges, kW = 9 + kHinges;

  explicit Case(const std::string& name) : model(ShippedModel(name)), dynamics(VehicleOf(model)) {}

  double Draw(double magnitude) {
    return magnitude * (2 * static_cast<double>(random()) / static_cast<double>(std::mt19937::max()) - 1);
  }
  void DrawPoint() {
    for (int i = 0; i < Size::kStates; ++i) x[i] = Draw(i >= kW ? 3 : 1);
    for (int i = 0; i < Size::kInputs; ++i) u[i] = i < kRotors ? 10 + Draw(5) : Draw(0.5);
  }

  plant::VehicleModel model;
  Dynamics<kHinges, kRotors> dynamics;
  std::mt19937 random{3};
  typename Size::State x;
  typename Size::Input u;
};

// w in B from the rates of roll, pitch and yaw.
Eigen::Vector3d BodyRates(const Eigen::Vector3d& angles, const Eigen::Vector3d& rates) {
  const double sr = std::sin(angles[0]), cr = std::cos(angles[0]), sp = std::sin(angles[1]),
               cp = std::cos(angles[1]);
  return {rates[0] - sp * rates[2], cr * rates[1] + sr * cp * rates[2], -sr * rates[1] + cr * cp * rates[2]};
}

template <int kHinges, int kRotors>
void ExpectPlantsAcceleration(Case<kHinges, kRotors> c) {
  using C = Case<kHinges, kRotors>;
  for (int round = 0; round < 20; ++round) {
    c.DrawPoint();
    const auto rate = c.dynamics.Rate(c.x, c.u, {});
    plant::Coordinates<plant::Complex> q = c.x.template head<6 + kHinges>(), q_dot(6 + kHinges);
    q_dot << c.x.template segment<3>(C::kV), rate.template segment<3>(3), c.x.template tail<kHinges>();
    const plant::Inputs<plant::Complex> u = c.u;
    const Eigen::VectorXd q_ddot = plant::Acceleration(c.model, q, q_dot, u).real();
    const Eigen::Vector3d angles = c.x.template segment<3>(3), rates = rate.template segment<3>(3);
    EXPECT_LT((BodyRates(angles, rates) - c.x.template segment<3>(C::kW)).norm(), 1e-12);
    constexpr double kStep = 1e-6;
    const Eigen::Vector3d angular =
        (BodyRates(angles + kStep * rates, rates + kStep * q_ddot.segment<3>(3)) -
         BodyRates(angles - kStep * rates, rates - kStep * q_ddot.segment<3>(3))) /
        (2 * kStep);
    EXPECT_LT((rate.template segment<3>(C::kV) - q_ddot.head<3>()).norm(), 1e-9 * (1 + q_ddot.norm()));
    EXPECT_LT((rate.template segment<3>(C::kW) - angular).norm(), 1e-6 * (1 + q_ddot.norm()));
    EXPECT_LT((rate.template tail<kHinges>() - q_ddot.tail(kHinges)).norm(), 1e-9 * (1 + q_ddot.norm()));
  }
}

TEST(NmpcDynamicsTest, AcceleratesAsThePlantDoes) {
  ExpectPlantsAcceleration(Case<2, 2>("tiltrotor"));
  ExpectPlantsAcceleration(Case<2, 2>("tiltrotor_published"));  // with thrusters off their hinges
  ExpectPlantsAcceleration(Case<0, 4>("quadrotor"));
}

template <int kHinges, int kRotors>
void ExpectDerivatives(Case<kHinges, kRotors> c) {
  using Size = Sizes<kHinges, kRotors>;
  constexpr double kLength_s = 0.05, kStep = 1e-6;
  const Disturbance disturbance = {.linear_m_s2 = {1, 2, 3}, .angular_rad_s2 = {3, 2, 1}};
  for (int round = 0; round < 5; ++round) {
    c.DrawPoint();
    const auto interval = c.dynamics.AdvanceLinearised(c.x, c.u, disturbance, kLength_s);
    EXPECT_LT((interval.end - c.dynamics.Advance(c.x, c.u, disturbance, kLength_s)).norm(),
              1e-12 * (1 + interval.end.norm()));
    const auto difference = [&](auto& moved, int i) {
      const double before = moved[i];
      moved[i] = before + kStep;
      const auto after = c.dynamics.Advance(c.x, c.u, disturbance, kLength_s);
      moved[i] = before - kStep;
      const auto ahead = c.dynamics.Advance(c.x, c.u, disturbance, kLength_s);
      moved[i] = before;
      return ((after - ahead) / (2 * kStep)).eval();
    };
    const double scale = 1 + interval.a.norm() + interval.b.norm();
    for (int i = 0; i < Size::kStates; ++i)
      EXPECT_LT((difference(c.x, i) - interval.a.col(i)).norm(), 1e-7 * scale) << "state " << i;
    for (int i = 0; i < Size::kInputs; ++i)
      EXPECT_LT((difference(c.u, i) - interval.b.col(i)).norm(), 1e-7 * scale) << "input " << i;
  }
}

TEST(NmpcDynamicsTest, HasTheDerivativesOfFiniteDifferences) {
  ExpectDerivatives(Case<2, 2>("tiltrotor_published"));
  ExpectDerivatives(Case<0, 4>("quadrotor"));
}

}  // namespace
}  // namespace tiltproof::nmpc
