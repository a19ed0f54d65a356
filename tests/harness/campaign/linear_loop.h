// A linear vehicle with the paper's sampled law, to judge flown margins by: no code of plant/ in it.
//
// The law samples the states each 12 ms, and its input takes over `delay_s` later. Its integrals are trapezoidal and
// include the present error. The period's map is built from what it does to each unit vector.
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <functional>
#include <unsupported/Eigen/MatrixFunctions>
#include <vector>

namespace tiltproof::testing {

struct LinearLoop {
  Eigen::MatrixXd a, b;  // x' = a x + b u
  Eigen::MatrixXd gain;  // of the first states that the law knows, and of the integrals of states 0, 1, 2, 5
  double period_s = 0.012;

  // Largest growth in one period; < 1 is stable. `factors` scale what each input does.
  double Growth(double delay_s, const Eigen::VectorXd& factors) const {
    const Eigen::Index n = a.rows(), m = b.cols(), known = gain.cols() - 4;
    const auto whole = static_cast<Eigen::Index>(std::floor(delay_s / period_s));
    const double rest_s = delay_s - static_cast<double>(whole) * period_s;
    const auto [a_before, b_before] = Held(rest_s, factors);
    const auto [a_after, b_after] = Held(period_s - rest_s, factors);
    const Eigen::Index size = n + 8 + m * (whole + 1);  // x, integrals, errors, past inputs
    Eigen::MatrixXd map(size, size);
    for (Eigen::Index j = 0; j < size; ++j) {
      const Eigen::VectorXd s = Eigen::VectorXd::Unit(size, j);
      const Eigen::VectorXd x = s.head(n);
      const Eigen::Vector4d error(x[0], x[1], x[2], x[5]);
      const Eigen::Vector4d integral = s.segment<4>(n) + period_s / 2 * (error + s.segment<4>(n + 4));
      Eigen::VectorXd fed(known + 4);
      fed << x.head(known), integral;
      Eigen::VectorXd inputs(m * (whole + 2));  // the newest first
      inputs << -gain * fed, s.tail(m * (whole + 1));
      Eigen::VectorXd next(size);
      next.head(n) = a_after * (a_before * x + b_before * inputs.segment(m * (whole + 1), m)) +
                     b_after * inputs.segment(m * whole, m);
      next.segment<4>(n) = integral;
      next.segment<4>(n + 4) = error;
      next.tail(m * (whole + 1)) = inputs.head(m * (whole + 1));
      map.col(j) = next;
    }
    return Eigen::EigenSolver<Eigen::MatrixXd>(map, false).eigenvalues().cwiseAbs().maxCoeff();
  }

  // The first delay that is unstable, to 1 us.
  double DelayMargin_s() const {
    const Eigen::VectorXd one = Eigen::VectorXd::Ones(b.cols());
    return Edge(0, 0.3, 0.25e-3, 1e-6, [&](double delay_s) { return Growth(delay_s, one) < 1; });
  }

  // The first factor below 1, of one input, that is unstable; 0 when none is.
  double GainMargin(Eigen::Index input) const {
    return Edge(1, 0, -0.005, 1e-5, [&](double factor) {
      Eigen::VectorXd factors = Eigen::VectorXd::Ones(b.cols());
      factors[input] = factor;
      return Growth(0, factors) < 1;
    });
  }

 private:
  std::pair<Eigen::MatrixXd, Eigen::MatrixXd> Held(double time_s, const Eigen::VectorXd& factors) const {
    const Eigen::Index n = a.rows(), m = b.cols();
    Eigen::MatrixXd all = Eigen::MatrixXd::Zero(n + m, n + m);
    all.topLeftCorner(n, n) = a * time_s;
    all.topRightCorner(n, m) = b * factors.asDiagonal() * time_s;
    const Eigen::MatrixXd grown = all.exp();
    return {grown.topLeftCorner(n, n), grown.topRightCorner(n, m)};
  }

  static double Edge(double from, double to, double step, double resolution,
                     const std::function<bool(double)>& stable) {
    double good = from;
    for (double next = from + step; step > 0 ? next <= to : next >= to; next += step) {
      if (stable(next)) {
        good = next;
        continue;
      }
      double bad = next;
      while (std::abs(bad - good) > resolution) {
        const double middle = (good + bad) / 2;
        (stable(middle) ? good : bad) = middle;
      }
      return good;
    }
    return to;
  }
};

// Central differences of an acceleration q''(q, q', u), as x' = a x + b u of x = (q, q').
inline LinearLoop Linearised(Eigen::Index coordinates, const Eigen::VectorXd& input,
                             const std::function<Eigen::VectorXd(const Eigen::VectorXd& state,
                                                                 const Eigen::VectorXd& input)>& acceleration,
                             const Eigen::VectorXd& state) {
  const Eigen::Index n = 2 * coordinates, m = input.size();
  LinearLoop loop;
  loop.a = Eigen::MatrixXd::Zero(n, n);
  loop.b = Eigen::MatrixXd::Zero(n, m);
  loop.a.topRightCorner(coordinates, coordinates).setIdentity();
  constexpr double kStep = 1e-6;
  for (Eigen::Index j = 0; j < n; ++j) {
    const Eigen::VectorXd d = kStep * Eigen::VectorXd::Unit(n, j);
    loop.a.col(j).tail(coordinates) =
        (acceleration(state + d, input) - acceleration(state - d, input)) / (2 * kStep);
  }
  for (Eigen::Index j = 0; j < m; ++j) {
    const Eigen::VectorXd d = kStep * Eigen::VectorXd::Unit(m, j);
    loop.b.col(j).tail(coordinates) =
        (acceleration(state, input + d) - acceleration(state, input - d)) / (2 * kStep);
  }
  return loop;
}

}  // namespace tiltproof::testing
