#include "tests/support/lagrange_model.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

namespace tiltproof::testing {
namespace {

using Eigen::Matrix3d;
using Eigen::Matrix4d;
using Eigen::Vector3d;
using Eigen::Vector4d;

constexpr double kGravity = 9.81;

// An elementary transform with first and second derivative with respect to its coordinate.
struct Factor {
  Matrix4d value, first, second;
};

// Turn about coordinate axis 0, 1 or 2.
Factor Turn(int axis, double angle) {
  const int i = (axis + 1) % 3, j = (axis + 2) % 3;
  const double c = std::cos(angle), s = std::sin(angle);
  Factor f{Matrix4d::Identity(), Matrix4d::Zero(), Matrix4d::Zero()};
  f.value(i, i) = f.value(j, j) = c;
  f.value(i, j) = -s;
  f.value(j, i) = s;
  f.first(i, i) = f.first(j, j) = -s;
  f.first(i, j) = -c;
  f.first(j, i) = c;
  f.second(i, i) = f.second(j, j) = -c;
  f.second(i, j) = s;
  f.second(j, i) = -s;
  return f;
}

// T(q) of one body, its derivatives by each coordinate, and T'' for q'' = 0, built up factor by factor.
struct Chain {
  Matrix4d value = Matrix4d::Identity();
  std::array<Matrix4d, 8> partial;
  Matrix4d rate = Matrix4d::Zero();    // dT/dt
  Matrix4d second = Matrix4d::Zero();  // d^2 T / dt^2 with q'' = 0

  Chain() { partial.fill(Matrix4d::Zero()); }

  void Translate(const LagrangeModel::Vector8& q, const LagrangeModel::Vector8& q_dot) {
    for (int i = 0; i < 3; ++i) {
      value(i, 3) = q[i];
      partial[static_cast<std::size_t>(i)](i, 3) = 1;
      rate(i, 3) = q_dot[i];
    }
  }
  void Multiply(const Matrix4d& constant) {
    value *= constant;
    for (Matrix4d& p : partial) p *= constant;
    rate *= constant;
    second *= constant;
  }
  void Multiply(std::size_t coordinate, const Factor& factor, double speed) {
    // (A B)'' = A'' B + 2 A' B' + A B'' with B' = dB/dq q', B'' = d2B/dq2 q'^2.
    second = second * factor.value + 2 * speed * rate * factor.first + speed * speed * value * factor.second;
    rate = rate * factor.value + speed * value * factor.first;
    for (Matrix4d& p : partial) p *= factor.value;
    partial[coordinate] += value * factor.first;
    value *= factor.value;
  }
};

Matrix4d PseudoInertia(const LagrangeParameters::Body& body) {
  // Second moments S = integral of r r' dm about the centre of mass, from I = tr(S) 1 - S.
  const Matrix3d s = 0.5 * body.inertia_kg_m2.trace() * Matrix3d::Identity() - body.inertia_kg_m2;
  Matrix4d j;
  j.topLeftCorner<3, 3>() = s + body.mass_kg * body.com_m * body.com_m.transpose();
  j.topRightCorner<3, 1>() = body.mass_kg * body.com_m;
  j.bottomLeftCorner<1, 3>() = body.mass_kg * body.com_m.transpose();
  j(3, 3) = body.mass_kg;
  return j;
}

// The base's chain, then those of the right and left thruster.
std::array<Chain, 3> Chains(const LagrangeParameters& parameters, const LagrangeModel::Vector8& q,
                            const LagrangeModel::Vector8& q_dot) {
  std::array<Chain, 3> chains;
  Chain& base = chains[0];
  base.Translate(q, q_dot);
  base.Multiply(5, Turn(2, q[5]), q_dot[5]);
  base.Multiply(4, Turn(1, q[4]), q_dot[4]);
  base.Multiply(3, Turn(0, q[3]), q_dot[3]);
  for (std::size_t side = 0; side < 2; ++side) {
    Chain& thruster = chains[side + 1] = base;
    Matrix4d offset = Matrix4d::Identity();
    offset.topRightCorner<3, 1>() = parameters.hinge_m[side];
    thruster.Multiply(offset);
    const Matrix4d roll = Turn(0, parameters.tilt_rad[side]).value;
    const auto alpha = static_cast<int>(6 + side);
    if (parameters.hinge_axis_tilted) thruster.Multiply(roll);
    thruster.Multiply(6 + side, Turn(1, q[alpha]), q_dot[alpha]);
    if (!parameters.hinge_axis_tilted) thruster.Multiply(roll);
  }
  return chains;
}

// tr(A J B^T)
double Trace(const Matrix4d& a, const Matrix4d& j, const Matrix4d& b) {
  return (a * j).cwiseProduct(b).sum();
}

}  // namespace

LagrangeParameters DesignPlant() {
  const auto diagonal = [](double x, double y, double z) -> Matrix3d {
    return Vector3d(x, y, z).asDiagonal();
  };
  LagrangeParameters p;
  p.base.mass_kg = 1.92509767079622;
  p.base.com_m = {-0.00254692194, 0.00013773408, -0.01819008141};
  p.base.inertia_kg_m2 << 0.0697552757250878, 4.77417385357503e-05, 0.000362780890165671,  //
      4.77417385357503e-05, 0.00792827006001647, -1.07360516340487e-05,                    //
      0.000362780890165671, -1.07360516340487e-05, 0.0664000187819483;
  p.thrusters[0] = {0.0809439719362664, Vector3d::Zero(),
                    diagonal(3.88267747e-5, 1.04858690e-4, 8.31755565e-5)};
  p.thrusters[1] = {0.080943968597, Vector3d::Zero(), diagonal(3.83153586e-5, 1.04858690e-4, 8.31755505e-5)};
  p.hinge_m = {Vector3d(0.00002, -0.27761, 0.05621), Vector3d(0.00002, 0.27761, 0.05621)};
  const double beta = 5 * std::numbers::pi / 180;
  p.tilt_rad = {-beta, beta};
  p.hinge_axis_tilted = true;
  p.drag_ratio_m = 1.7e-7 / 9.5e-6;
  return p;
}

LagrangeParameters PublishedPlant() {
  LagrangeParameters p = DesignPlant();
  p.thrusters[0].com_m = {-3.60859273452335e-10, -0.000226380714807978, 0.0594780519701684};
  p.thrusters[0].inertia_kg_m2 << 3.88267747087835e-05, 6.03219085082653e-06, -2.78471406661236e-12,  //
      6.03219085082653e-06, 0.000104858690365283, 7.0486590219062e-07,                                //
      -2.78471406661236e-12, 7.0486590219062e-07, 8.31755564684115e-05;
  p.thrusters[1].com_m = {-1.42036961055594e-09, 0.000226379941183831, 0.059478050752241};
  p.thrusters[1].inertia_kg_m2 << 3.83153585987037e-05, 1.31505388597772e-06, 5.68869331986483e-13,  //
      1.31505388597772e-06, 0.000105370094312002, -7.048667055410379e-07,                            //
      5.68869331986483e-13, -7.048667055410379e-07, 8.31755504678384e-05;
  p.tilt_rad = {-0.0872665, 0.0872665};
  p.hinge_axis_tilted = false;
  return p;
}

LagrangeModel::LagrangeModel(const LagrangeParameters& parameters)
    : parameters_(parameters),
      pseudo_inertia_{PseudoInertia(parameters.base), PseudoInertia(parameters.thrusters[0]),
                      PseudoInertia(parameters.thrusters[1])} {}

LagrangeModel::Vector8 LagrangeModel::Acceleration(const Vector8& q, const Vector8& q_dot,
                                                   const ActuatorsTruth& u) const {
  const std::array<Chain, 3> chains = Chains(parameters_, q, q_dot);
  const std::array<double, 2> forces = {u.f_r_n, u.f_l_n}, torques = {u.tau_r_nm, u.tau_l_nm};
  Eigen::Matrix<double, 8, 8> mass = Eigen::Matrix<double, 8, 8>::Zero();
  Vector8 right = Vector8::Zero();
  for (std::size_t body = 0; body < chains.size(); ++body) {
    const Chain& chain = chains[body];
    const Matrix4d& inertia = pseudo_inertia_[body];
    for (int i = 0; i < 8; ++i) {
      const Matrix4d weighted = chain.partial[static_cast<std::size_t>(i)] * inertia;
      for (int j = 0; j <= i; ++j) {
        const double element = weighted.cwiseProduct(chain.partial[static_cast<std::size_t>(j)]).sum();
        mass(i, j) += element;
        if (j != i) mass(j, i) += element;
      }
      // Gravity: minus the derivative of the potential m g z, whose m z is the pseudo-inertia's last column,
      // third row.
      right[i] -= weighted.cwiseProduct(chain.second).sum() + kGravity * weighted(2, 3);
    }
  }
  for (std::size_t side = 0; side < 2; ++side) {
    const Chain& chain = chains[side + 1];
    const Vector4d com = parameters_.thrusters[side].com_m.homogeneous();
    const Matrix3d rotation = chain.value.topLeftCorner<3, 3>();
    const Vector3d axis = rotation.col(2);
    const double drag = (side == 0 ? 1 : -1) * parameters_.drag_ratio_m * forces[side];
    for (int i = 0; i < 8; ++i) {
      const Matrix4d& partial = chain.partial[static_cast<std::size_t>(i)];
      // Virtual work of the thrust at the centre of mass, and of the torque: dR R^T is the skew matrix of the
      // turn.
      right[i] += forces[side] * axis.dot((partial * com).head<3>());
      const Matrix3d skew = partial.topLeftCorner<3, 3>() * rotation.transpose();
      right[i] += drag * axis.dot(Vector3d(skew(2, 1), skew(0, 2), skew(1, 0)));
    }
    right[static_cast<int>(6 + side)] += torques[side];
  }
  return mass.llt().solve(right);
}

void LagrangeModel::Advance(const ActuatorsTruth& u, double h, State& state) const {
  const Vector8 v1 = state.q_dot, a1 = Acceleration(state.q, v1, u);
  const Vector8 v2 = state.q_dot + 0.5 * h * a1, a2 = Acceleration(state.q + 0.5 * h * v1, v2, u);
  const Vector8 v3 = state.q_dot + 0.5 * h * a2, a3 = Acceleration(state.q + 0.5 * h * v2, v3, u);
  const Vector8 v4 = state.q_dot + h * a3, a4 = Acceleration(state.q + h * v3, v4, u);
  state.q += h / 6 * (v1 + 2 * v2 + 2 * v3 + v4);
  state.q_dot += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
}

double LagrangeModel::Energy(const State& state) const {
  const std::array<Chain, 3> chains = Chains(parameters_, state.q, state.q_dot);
  double energy = 0;
  for (std::size_t body = 0; body < chains.size(); ++body) {
    const Chain& chain = chains[body];
    energy += 0.5 * Trace(chain.rate, pseudo_inertia_[body], chain.rate) +
              kGravity * (chain.value * pseudo_inertia_[body])(2, 3);
  }
  return energy;
}

SensorsTruth ToSensors(const LagrangeModel::State& state) {
  const auto& q = state.q;
  const auto& v = state.q_dot;
  const double cp = std::cos(q[4]), sp = std::sin(q[4]), cy = std::cos(q[5]), sy = std::sin(q[5]);
  SensorsTruth s{.x_m = q[0],
                 .y_m = q[1],
                 .z_m = q[2],
                 .roll_rad = q[3],
                 .pitch_rad = q[4],
                 .yaw_rad = std::remainder(q[5], 2 * std::numbers::pi),
                 .alpha_r_rad = q[6],
                 .alpha_l_rad = q[7],
                 .vx_m_s = v[0],
                 .vy_m_s = v[1],
                 .vz_m_s = v[2],
                 .wx_rad_s = cy * cp * v[3] - sy * v[4],
                 .wy_rad_s = sy * cp * v[3] + cy * v[4],
                 .wz_rad_s = -sp * v[3] + v[5],
                 .alpha_r_rad_s = v[6],
                 .alpha_l_rad_s = v[7]};
  return s;
}

SensorsTruth ToSensorsWithEulerRates(const LagrangeModel::State& state) {
  SensorsTruth s = ToSensors(state);
  s.wx_rad_s = state.q_dot[3];
  s.wy_rad_s = state.q_dot[4];
  s.wz_rad_s = state.q_dot[5];
  return s;
}

}  // namespace tiltproof::testing
