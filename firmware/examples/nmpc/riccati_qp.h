// A quadratic program of optimal control: interior-point iterations whose linear systems a Riccati recursion solves.
//
//   RiccatiQp<2, 1, 1> qp(20);                      // states, inputs, rows of soft constraints; intervals
//   qp.stages[0].a.setIdentity();                   // and all other data
//   const QpResult result = qp.Solve(x_0, 30);      // qp.x[k], qp.u[k]
//
//   minimise  sum over k < n of 1/2 x_k'Q_k x_k + q_k'x_k + 1/2 u_k'R_k u_k + r_k'u_k, + 1/2 x_n'Q_n x_n + q_n'x_n
//             + sum over k = 1..n of penalty(C x_k)
//   subject to  x_{k+1} = A_k x_k + B_k u_k + b_k,   u_min_k <= u_k <= u_max_k
//
//   penalty(c) = for each row with the excess e = max(c - c_max, c_min - c, 0):  linear e + 1/2 quadratic e^2
//
// A soft constraint never makes the program unsolvable. It is kept exactly when `linear` is larger than its multiplier.
// Q_k must be positive semidefinite, R_k and Q_n positive definite, and u_min < u_max, c_min < c_max. The first solution
// ignores all limits; where it keeps them, it is the answer. Otherwise primal-dual steps follow (Wright, "Primal-dual
// interior-point methods", 1997, chapter 11), each a Riccati recursion over the horizon (Rao, Wright, Rawlings, J. Optim.
// Theory Appl. 99, 1998). No heap after the constructor.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstddef>
#include <vector>

namespace tiltproof::nmpc {

struct QpResult {
  int sweeps = 0;          // Riccati recursions
  bool converged = false;  // the gap between the costs of program and dual is closed
};

template <int kStates, int kInputs, int kRows>
class RiccatiQp {
 public:
  using State = Eigen::Matrix<double, kStates, 1>;
  using Input = Eigen::Matrix<double, kInputs, 1>;
  using Rows = Eigen::Matrix<double, kRows, 1>;

  // The cost is diagonal in each interval.
  struct Stage {
    Eigen::Matrix<double, kStates, kStates> a;
    Eigen::Matrix<double, kStates, kInputs> b;
    State offset, cost_x, slope_x;
    Input cost_u, slope_u, u_min, u_max;
  };
  struct Soft {
    Eigen::Matrix<double, kRows, kStates> rows = Eigen::Matrix<double, kRows, kStates>::Zero();
    Rows min = Rows::Constant(-1), max = Rows::Constant(1), linear = Rows::Constant(1),
         quadratic = Rows::Constant(1);
  };

  explicit RiccatiQp(std::size_t intervals)
      : stages(intervals),
        soft_weight(intervals + 1, 1.0),
        x(intervals + 1),
        u(intervals),
        next_x_(intervals + 1),
        next_u_(intervals),
        gains_(intervals),
        hard_(intervals),
        soft_limits_(intervals + 1) {}

  std::vector<Stage> stages;
  Eigen::Matrix<double, kStates, kStates> cost_end = Eigen::Matrix<double, kStates, kStates>::Identity();
  State slope_end = State::Zero();
  Soft soft;
  std::vector<double> soft_weight;  // of the penalties at each k; that of k = 0 is not used

  // The solution of the last Solve.
  std::vector<State> x;
  std::vector<Input> u;

  QpResult Solve(const State& start, int sweeps_max) {
    QpResult result;
    start_ = start;
    for (auto& limits : hard_) limits = {};
    for (auto& limits : soft_limits_) limits = {};
    Sweep(x, u);
    ++result.sweeps;
    if (KeepsLimits()) {
      result.converged = true;
      return result;
    }
    StartInside();
    while (result.sweeps < sweeps_max) {
      const double gap = Gap();
      if (gap < kGap) {
        result.converged = true;
        break;
      }
      Step(kCentring * gap);
      ++result.sweeps;
    }
    for (std::size_t k = 0; k < u.size(); ++k)
      u[k] = u[k].cwiseMax(stages[k].u_min).cwiseMin(stages[k].u_max);
    return result;
  }

 private:
  static constexpr double kGap = 1e-7, kCentring = 0.15, kToBoundary = 0.99;

  // One limit g'z <= d: the slack t of the constraint and its multiplier; the slack s of a soft one and its multiplier.
  struct Limit {
    double t = 1, multiplier = 0, excess = 0, excess_multiplier = 0;
    double t_step = 0, multiplier_step = 0, excess_step = 0, excess_multiplier_step = 0;
  };
  // The upper and the lower limit of each input or row.
  template <int n>
  struct Limits {
    std::array<std::array<Limit, 2>, static_cast<std::size_t>(n > 0 ? n : 1)> limit{};
    Eigen::Matrix<double, n, 1> weight = Eigen::Matrix<double, n, 1>::Zero(),
                                slope = Eigen::Matrix<double, n, 1>::Zero();
  };
  struct Gain {
    Eigen::Matrix<double, kInputs, kStates> k;
    Input k_0;
  };

  // Calls f(limit, sign, value, bound, is_soft, row, k) for each limit: sign value <= sign bound.
  template <class Function>
  void ForEach(const std::vector<State>& states, const std::vector<Input>& inputs, const Function& f) {
    for (std::size_t k = 0; k < inputs.size(); ++k)
      for (int i = 0; i < kInputs; ++i) {
        auto& pair = hard_[k].limit[static_cast<std::size_t>(i)];
        f(pair[0], 1.0, inputs[k][i], stages[k].u_max[i], false, i, k);
        f(pair[1], -1.0, inputs[k][i], stages[k].u_min[i], false, i, k);
      }
    for (std::size_t k = 1; k < states.size(); ++k) {
      const Rows values = soft.rows * states[k];
      for (int i = 0; i < kRows; ++i) {
        auto& pair = soft_limits_[k].limit[static_cast<std::size_t>(i)];
        f(pair[0], 1.0, values[i], soft.max[i], true, i, k);
        f(pair[1], -1.0, values[i], soft.min[i], true, i, k);
      }
    }
  }

  bool KeepsLimits() {
    bool keeps = true;
    ForEach(x, u, [&](Limit&, double sign, double value, double bound, bool, int, std::size_t) {
      keeps = keeps && sign * value <= sign * bound;
    });
    return keeps;
  }

  // Slacks and multipliers to begin with. The states and inputs satisfy the dynamics, and may break the limits.
  void StartInside() {
    ForEach(
        x, u, [&](Limit& at, double sign, double value, double bound, bool is_soft, int i, std::size_t k) {
          const double width = is_soft ? soft.max[i] - soft.min[i] : stages[k].u_max[i] - stages[k].u_min[i];
          const double room = sign * (bound - value);
          const double slope = is_soft ? soft_weight[k] * soft.linear[i] : 0;
          at.t = std::max(room, 0.05 * width);
          at.multiplier = is_soft ? 0.5 * slope : kMultiplierStart / at.t;
          at.excess = is_soft ? std::max(-room, 0.0) + 0.05 * width : 0;
          at.excess_multiplier = is_soft ? 0.5 * slope : 0;
        });
  }

  double Gap() {
    double sum = 0;
    int count = 0;
    ForEach(x, u, [&](Limit& at, double sign, double value, double bound, bool is_soft, int, std::size_t) {
      // A limit that is not met yet counts, too.
      const double missing = at.t - at.excess - sign * (bound - value);
      sum += at.t * at.multiplier + at.excess * at.excess_multiplier + std::abs(missing);
      count += is_soft ? 2 : 1;
    });
    return sum / count;
  }

  // One step of Newton's method towards products of slack and multiplier of `target`.
  void Step(double target) {
    for (auto& limits : hard_) {
      limits.weight.setZero();
      limits.slope.setZero();
    }
    for (auto& limits : soft_limits_) {
      limits.weight.setZero();
      limits.slope.setZero();
    }
    ForEach(x, u, [&](Limit& at, double sign, double, double bound, bool is_soft, int i, std::size_t k) {
      const double w = at.multiplier / at.t;
      double weight = w, constant = target / at.t + w * (at.t - sign * bound);
      if (is_soft) {
        const double linear = soft_weight[k] * soft.linear[i], quadratic = soft_weight[k] * soft.quadratic[i];
        const double v = at.excess_multiplier / at.excess, all = quadratic + v + w;
        const double rest = target / at.t + target / at.excess - linear - quadratic * at.excess;
        weight = w * (quadratic + v) / all;
        constant = target / at.t - w * rest / all + weight * (at.t - sign * bound - at.excess);
        soft_limits_[k].weight[i] += weight;
        soft_limits_[k].slope[i] += sign * constant;
      } else {
        hard_[k].weight[i] += weight;
        hard_[k].slope[i] += sign * constant;
      }
    });
    Sweep(next_x_, next_u_);
    // The limits' own steps follow from those of states and inputs.
    double primal = 1, dual = 1;
    const auto shorten = [](double value, double step, double& length) {
      if (step < 0) length = std::min(length, -kToBoundary * value / step);
    };
    ForEach(next_x_, next_u_,
            [&](Limit& at, double sign, double value, double bound, bool is_soft, int i, std::size_t k) {
              const double w = at.multiplier / at.t;
              const double y = sign * (value - bound) + at.t - at.excess;
              if (is_soft) {
                const double linear = soft_weight[k] * soft.linear[i],
                             quadratic = soft_weight[k] * soft.quadratic[i];
                const double v = at.excess_multiplier / at.excess;
                const double rest = target / at.t + target / at.excess - linear - quadratic * at.excess;
                at.excess_step = (rest + w * y) / (quadratic + v + w);
                at.excess_multiplier_step = target / at.excess - at.excess_multiplier - v * at.excess_step;
                shorten(at.excess, at.excess_step, primal);
                shorten(at.excess_multiplier, at.excess_multiplier_step, dual);
              }
              at.t_step = (is_soft ? at.excess_step : 0) - y;
              at.multiplier_step = target / at.t - at.multiplier - w * at.t_step;
              shorten(at.t, at.t_step, primal);
              shorten(at.multiplier, at.multiplier_step, dual);
            });
    // The cost is quadratic, so both take the shorter length.
    const double length = std::min(primal, dual);
    for (std::size_t k = 0; k < x.size(); ++k) x[k] += length * (next_x_[k] - x[k]);
    for (std::size_t k = 0; k < u.size(); ++k) u[k] += length * (next_u_[k] - u[k]);
    ForEach(x, u, [&](Limit& at, double, double, double, bool, int, std::size_t) {
      at.t += length * at.t_step;
      at.multiplier += length * at.multiplier_step;
      at.excess += length * at.excess_step;
      at.excess_multiplier += length * at.excess_multiplier_step;
    });
  }

  // Solves the program without limits and with their weights, into `states` and `inputs`.
  void Sweep(std::vector<State>& states, std::vector<Input>& inputs) {
    const std::size_t n = stages.size();
    Eigen::Matrix<double, kStates, kStates> p = cost_end;
    State s = slope_end;
    AddSoft(n, p, s);
    for (std::size_t k = n; k-- > 0;) {
      const Stage& stage = stages[k];
      const State after = s + p * stage.offset;
      Eigen::Matrix<double, kStates, kStates> pa;
      Eigen::Matrix<double, kStates, kInputs> pb;
      pa.noalias() = p * stage.a;
      pb.noalias() = p * stage.b;
      Eigen::Matrix<double, kInputs, kInputs> h;
      h.noalias() = stage.b.transpose() * pb;
      h.diagonal() += stage.cost_u + hard_[k].weight;
      Eigen::Matrix<double, kInputs, kStates> g;
      g.noalias() = stage.b.transpose() * pa;
      const Input slope_u = stage.slope_u + hard_[k].slope + stage.b.transpose() * after;
      const Eigen::LLT<Eigen::Matrix<double, kInputs, kInputs>> solver(h);
      gains_[k].k = -solver.solve(g);
      gains_[k].k_0 = -solver.solve(slope_u);
      p.noalias() = stage.a.transpose() * pa;
      p.noalias() += g.transpose() * gains_[k].k;
      p = 0.5 * (p + p.transpose()).eval();
      p.diagonal() += stage.cost_x;
      s = stage.slope_x + stage.a.transpose() * after + g.transpose() * gains_[k].k_0;
      if (k > 0) AddSoft(k, p, s);
    }
    states[0] = start_;
    for (std::size_t k = 0; k < n; ++k) {
      inputs[k] = gains_[k].k * states[k] + gains_[k].k_0;
      states[k + 1] = stages[k].a * states[k] + stages[k].b * inputs[k] + stages[k].offset;
    }
  }
  void AddSoft(std::size_t k, Eigen::Matrix<double, kStates, kStates>& p, State& s) {
    const auto& limits = soft_limits_[k];
    if ((limits.weight.array() == 0).all()) return;
    p += soft.rows.transpose() * limits.weight.asDiagonal() * soft.rows;
    s += soft.rows.transpose() * limits.slope;
  }

  static constexpr double kMultiplierStart = 1e-2;

  State start_ = State::Zero();
  std::vector<State> next_x_;
  std::vector<Input> next_u_;
  std::vector<Gain> gains_;
  std::vector<Limits<kInputs>> hard_;
  std::vector<Limits<kRows>> soft_limits_;
};

}  // namespace tiltproof::nmpc
