// The quadratic program against a slow reference: all sets of active constraints, tried one by one.
#include "firmware/examples/nmpc/riccati_qp.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <array>
#include <cmath>
#include <optional>
#include <random>
#include <vector>

namespace tiltproof::nmpc {
namespace {

constexpr int kIntervals = 3;
using Qp = RiccatiQp<2, 1, 1>;
using Inputs = Eigen::Vector3d;

// The program in the inputs alone: cost 1/2 U'HU + g'U, and the soft row's value at k + 1 is row.U + constant.
struct Condensed {
  Eigen::Matrix3d h = Eigen::Matrix3d::Zero();
  Eigen::Vector3d g = Eigen::Vector3d::Zero();
  std::array<Eigen::Vector3d, kIntervals> row;
  std::array<double, kIntervals> constant;
};

Condensed Condense(const Qp& qp, const Eigen::Vector2d& start) {
  Condensed condensed;
  Eigen::Matrix<double, 2, 3> slope = Eigen::Matrix<double, 2, 3>::Zero();
  Eigen::Vector2d x = start;  // with inputs of zero
  const auto add = [&](const Eigen::Matrix2d& cost, const Eigen::Vector2d& linear) {
    condensed.h += slope.transpose() * cost * slope;
    condensed.g += slope.transpose() * (cost * x + linear);
  };
  for (int k = 0; k < kIntervals; ++k) {
    const auto& stage = qp.stages[static_cast<std::size_t>(k)];
    add(stage.cost_x.asDiagonal(), stage.slope_x);
    condensed.h(k, k) += stage.cost_u[0];
    condensed.g[k] += stage.slope_u[0];
    slope = (stage.a * slope).eval();
    slope.col(k) += stage.b;
    x = stage.a * x + stage.offset;
    condensed.row[static_cast<std::size_t>(k)] = (qp.soft.rows * slope).transpose();
    condensed.constant[static_cast<std::size_t>(k)] = (qp.soft.rows * x)(0);
  }
  add(qp.cost_end, qp.slope_end);
  return condensed;
}

// An input is free, at its upper or at its lower limit. A soft row is inside, at or beyond its upper or lower limit.
enum { kFree, kUpper, kLower, kInputCases };
enum { kInside, kAtUpper, kBeyondUpper, kAtLower, kBeyondLower, kRowCases };

// The minimum where exactly these are active; none when it does not satisfy the conditions of Karush, Kuhn and Tucker.
std::optional<Inputs> TryActive(const Qp& qp, const Condensed& condensed, const std::array<int, 3>& inputs,
                                const std::array<int, 3>& rows) {
  constexpr double kTolerance = 1e-9;
  Eigen::Matrix3d h = condensed.h;
  Eigen::Vector3d g = condensed.g;
  std::vector<Eigen::Vector3d> normals;
  std::vector<double> values;
  const auto limit_of = [&](int row_case) {
    return row_case <= kBeyondUpper ? qp.soft.max[0] : qp.soft.min[0];
  };
  for (std::size_t k = 0; k < 3; ++k) {
    const auto& stage = qp.stages[k];
    if (inputs[k] != kFree) {
      normals.push_back(Eigen::Vector3d::Unit(static_cast<int>(k)));
      values.push_back(inputs[k] == kUpper ? stage.u_max[0] : stage.u_min[0]);
    }
    const double weight = qp.soft_weight[k + 1];
    if (rows[k] == kAtUpper || rows[k] == kAtLower) {
      normals.push_back(condensed.row[k]);
      values.push_back(limit_of(rows[k]) - condensed.constant[k]);
    } else if (rows[k] != kInside) {
      const double sign = rows[k] == kBeyondUpper ? 1 : -1, quadratic = weight * qp.soft.quadratic[0];
      h += quadratic * condensed.row[k] * condensed.row[k].transpose();
      g += condensed.row[k] *
           (sign * weight * qp.soft.linear[0] + quadratic * (condensed.constant[k] - limit_of(rows[k])));
    }
  }
  const auto m = static_cast<Eigen::Index>(normals.size());
  Eigen::MatrixXd kkt = Eigen::MatrixXd::Zero(3 + m, 3 + m);
  Eigen::VectorXd right(3 + m);
  kkt.topLeftCorner(3, 3) = h;
  right.head(3) = -g;
  for (Eigen::Index i = 0; i < m; ++i) {
    kkt.block(0, 3 + i, 3, 1) = normals[static_cast<std::size_t>(i)];
    kkt.block(3 + i, 0, 1, 3) = normals[static_cast<std::size_t>(i)].transpose();
    right[3 + i] = values[static_cast<std::size_t>(i)];
  }
  const Eigen::FullPivLU<Eigen::MatrixXd> solver(kkt);
  if (!solver.isInvertible()) return std::nullopt;
  const Eigen::VectorXd solution = solver.solve(right);
  const Inputs u = solution.head(3);
  Eigen::Index place = 3;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto& stage = qp.stages[k];
    const double value = u[static_cast<int>(k)], c = condensed.row[k].dot(u) + condensed.constant[k];
    if (value > stage.u_max[0] + kTolerance || value < stage.u_min[0] - kTolerance) return std::nullopt;
    if (inputs[k] != kFree && (inputs[k] == kUpper ? 1 : -1) * solution[place++] < 0) return std::nullopt;
    const double excess = std::max(c - qp.soft.max[0], qp.soft.min[0] - c);
    if (rows[k] == kInside && excess > kTolerance) return std::nullopt;
    if (rows[k] == kBeyondUpper && c < qp.soft.max[0]) return std::nullopt;
    if (rows[k] == kBeyondLower && c > qp.soft.min[0]) return std::nullopt;
    if (rows[k] == kAtUpper || rows[k] == kAtLower) {
      const double multiplier = (rows[k] == kAtUpper ? 1 : -1) * solution[place++];
      if (multiplier < 0 || multiplier > qp.soft_weight[k + 1] * qp.soft.linear[0]) return std::nullopt;
    }
  }
  return u;
}

std::optional<Inputs> SlowSolution(const Qp& qp, const Eigen::Vector2d& start, bool& limits_matter) {
  const Condensed condensed = Condense(qp, start);
  for (int choice = 0; choice < kInputCases * kInputCases * kInputCases * kRowCases * kRowCases * kRowCases;
       ++choice) {
    std::array<int, 3> inputs{}, rows{};
    int rest = choice;
    for (int& each : inputs) {
      each = rest % kInputCases;
      rest /= kInputCases;
    }
    for (int& each : rows) {
      each = rest % kRowCases;
      rest /= kRowCases;
    }
    limits_matter = choice != 0;
    if (const auto u = TryActive(qp, condensed, inputs, rows)) return u;
  }
  return std::nullopt;
}

TEST(RiccatiQpTest, FindsTheSolutionOfAllActiveSets) {
  std::mt19937 random(7);
  const auto draw = [&](double low, double high) {
    return low + (high - low) * (static_cast<double>(random()) / static_cast<double>(std::mt19937::max()));
  };
  int limited = 0;
  for (int round = 0; round < 150; ++round) {
    Qp qp(kIntervals);
    for (auto& stage : qp.stages) {
      stage.a << draw(-1, 1), draw(-1, 1), draw(-1, 1), draw(-1, 1);
      stage.b << draw(-1, 1), draw(-1, 1);
      stage.offset << draw(-1, 1), draw(-1, 1);
      stage.cost_x << draw(0, 2), draw(0, 2);
      stage.slope_x << draw(-2, 2), draw(-2, 2);
      stage.cost_u << draw(0.1, 2);
      stage.slope_u << draw(-2, 2);
      stage.u_min << draw(-1, -0.1);
      stage.u_max << draw(0.1, 1);
    }
    qp.soft.rows << draw(-1, 1), draw(-1, 1);
    qp.soft.min << draw(-1, -0.1);
    qp.soft.max << draw(0.1, 1);
    qp.soft.linear << draw(0.1, 5);
    qp.soft.quadratic << draw(0.1, 5);
    for (double& weight : qp.soft_weight) weight = draw(0.2, 2);
    const Eigen::Vector2d start(draw(-1, 1), draw(-1, 1));

    bool limits_matter = false;
    const auto expected = SlowSolution(qp, start, limits_matter);
    ASSERT_TRUE(expected) << round;
    limited += limits_matter ? 1 : 0;
    const QpResult result = qp.Solve(start, 60);
    EXPECT_TRUE(result.converged) << round;
    EXPECT_EQ(result.sweeps == 1, !limits_matter) << round;
    for (std::size_t k = 0; k < 3; ++k)
      EXPECT_NEAR(qp.u[k][0], (*expected)[static_cast<int>(k)], 2e-4) << round << ", " << k;
  }
  EXPECT_GT(limited, 75);
}

}  // namespace
}  // namespace tiltproof::nmpc
