#include "tests/support/newton_euler_model.h"

#include <Eigen/Dense>
#include <optional>

namespace tiltproof::testing {
namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

Matrix3d Cross(const Vector3d& v) {
  Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

// The load on a body, all along the world's axes: force, and torque about its centre of mass.
struct Wrench {
  Vector3d force = Vector3d::Zero(), torque = Vector3d::Zero();
};

Wrench ThrustOn(const plant::VehicleModel& model, std::optional<std::size_t> hinge, const Vector3d& p_com_m,
                const Matrix3d& R_WL, const VectorXd& u) {
  Wrench sum;
  for (std::size_t i = 0; i < model.rotors.size(); ++i) {
    const plant::Rotor& rotor = model.rotors[i];
    if (rotor.hinge != hinge) continue;
    const Vector3d thrust = R_WL * rotor.thrust_axis_L * u[static_cast<Index>(i)];
    const Vector3d arm = R_WL * (rotor.p_LR_m - p_com_m);
    sum.force += thrust;
    sum.torque += arm.cross(thrust) + thrust * (rotor.direction * rotor.drag_ratio_m);
  }
  return sum;
}

}  // namespace

VectorXd NewtonEulerAcceleration(const plant::VehicleModel& model, const VectorXd& q, const VectorXd& q_dot,
                                 const VectorXd& u) {
  const Vector3d gravity(0, 0, -9.81);
  const Matrix3d R_z = Eigen::AngleAxisd(q[5], Vector3d::UnitZ()).toRotationMatrix();
  const Matrix3d R_zy = R_z * Eigen::AngleAxisd(q[4], Vector3d::UnitY()).toRotationMatrix();
  const Matrix3d R = R_zy * Eigen::AngleAxisd(q[3], Vector3d::UnitX()).toRotationMatrix();
  Matrix3d euler;  // w = euler * (roll, pitch, yaw)'
  euler << R_zy.col(0), R_z.col(1), Vector3d::UnitZ();
  const Vector3d w = euler * q_dot.segment<3>(3);
  const Vector3d c = R * model.base.p_com_m;

  // Unknowns: the base's a (3) and w' (3); then for each hinge a (3), w' (3), F (3) and N (3) on the hinged body, and
  // alpha'' (1).
  const auto hinge_count = static_cast<Index>(model.hinges.size());
  constexpr Index kEach = 13;
  MatrixXd left = MatrixXd::Zero(6 + kEach * hinge_count, 6 + kEach * hinge_count);
  VectorXd right = VectorXd::Zero(left.rows());
  const Matrix3d one = Matrix3d::Identity();
  const Matrix3d inertia = R * model.base.inertia_kg_m2 * R.transpose();
  const Wrench base = ThrustOn(model, std::nullopt, model.base.p_com_m, R, u);
  left.block<3, 3>(0, 0) = model.base.mass_kg * one;
  right.segment<3>(0) = model.base.mass_kg * gravity + base.force;
  left.block<3, 3>(3, 3) = inertia;
  right.segment<3>(3) = base.torque - w.cross(inertia * w);
  for (Index i = 0; i < hinge_count; ++i) {
    const plant::Hinge& hinge = model.hinges[static_cast<std::size_t>(i)];
    const Matrix3d turn = Eigen::AngleAxisd(q[6 + i], hinge.axis_B).toRotationMatrix();
    const Matrix3d R_T = R * turn * hinge.R_BT;
    const Vector3d axis = R * hinge.axis_B;
    const Vector3d w_T = w + axis * q_dot[6 + i];
    const Matrix3d inertia_T = R_T * hinge.body.inertia_kg_m2 * R_T.transpose();
    const Vector3d p_H = R * hinge.p_BH_m;
    const Vector3d p_T = p_H + R * turn * (hinge.p_BT_m + hinge.R_BT * hinge.body.p_com_m - hinge.p_BH_m);
    const Vector3d from_T = p_H - p_T, from_base = p_H - c;
    const Wrench thrust = ThrustOn(model, static_cast<std::size_t>(i), hinge.body.p_com_m, R_T, u);
    const Index a = 6 + kEach * i, wd = a + 3, f = a + 6, n = a + 9, alpha = a + 12;
    left.block<3, 3>(0, f) += one;
    left.block<3, 3>(3, f) += Cross(from_base);
    left.block<3, 3>(3, n) += one;
    // The hinged body.
    left.block<3, 3>(a, a) = hinge.body.mass_kg * one;
    left.block<3, 3>(a, f) = -one;
    right.segment<3>(a) = hinge.body.mass_kg * gravity + thrust.force;
    left.block<3, 3>(wd, wd) = inertia_T;
    left.block<3, 3>(wd, n) = -one;
    left.block<3, 3>(wd, f) = -Cross(from_T);
    right.segment<3>(wd) = thrust.torque - w_T.cross(inertia_T * w_T);
    // The hinge's point and axis are in both bodies, and the servo turns about the axis.
    left.block<3, 3>(f, wd) = one;
    left.block<3, 3>(f, 3) = -one;
    left.block<3, 1>(f, alpha) = -axis;
    right.segment<3>(f) = w.cross(axis) * q_dot[6 + i];
    left.block<3, 3>(n, a) = one;
    left.block<3, 3>(n, wd) = -Cross(from_T);
    left.block<3, 3>(n, 0) = -one;
    left.block<3, 3>(n, 3) = Cross(from_base);
    right.segment<3>(n) = w.cross(w.cross(from_base)) - w_T.cross(w_T.cross(from_T));
    left.block<1, 3>(alpha, n) = axis.transpose();
    right[alpha] = u[static_cast<Index>(model.rotors.size()) + i];
  }
  const VectorXd solved = left.fullPivLu().solve(right);

  VectorXd result(6 + hinge_count);
  const Vector3d a_com = solved.head<3>(), w_dot = solved.segment<3>(3);
  result.head<3>() = a_com - w_dot.cross(c) - w.cross(w.cross(c));
  // w' = euler (roll, pitch, yaw)'' + euler' (roll, pitch, yaw)'.
  const Vector3d w_yaw = euler.col(2) * q_dot[5], w_pitch = w_yaw + euler.col(1) * q_dot[4];
  const Vector3d rest = w_pitch.cross(euler.col(0)) * q_dot[3] + w_yaw.cross(euler.col(1)) * q_dot[4];
  result.segment<3>(3) = euler.fullPivLu().solve(w_dot - rest);
  for (Index i = 0; i < hinge_count; ++i) result[6 + i] = solved[6 + kEach * i + 12];
  return result;
}

}  // namespace tiltproof::testing
