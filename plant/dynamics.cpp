#include "plant/dynamics.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <string>

namespace tiltproof::plant {
namespace {

using Vector3 = Eigen::Matrix<Complex, 3, 1>;
using Matrix3 = Eigen::Matrix<Complex, 3, 3>;
using Jacobian = Eigen::Matrix<Complex, 3, kCoordinateCount>;

constexpr double kComplexStep = 1e-30;

// Written out: those of the C library would differ between processors.
Complex Sin(const Complex& z) {
  return {std::sin(z.real()) * std::cosh(z.imag()), std::cos(z.real()) * std::sinh(z.imag())};
}
Complex Cos(const Complex& z) {
  return {std::cos(z.real()) * std::cosh(z.imag()), -std::sin(z.real()) * std::sinh(z.imag())};
}

// Eigen's own cross() conjugates complex numbers, which would spoil a complex step.
Vector3 Cross(const Vector3& a, const Vector3& b) {
  return {a.y() * b.z() - a.z() * b.y(), a.z() * b.x() - a.x() * b.z(), a.x() * b.y() - a.y() * b.x()};
}

Matrix3 Rotation(const Eigen::Vector3d& axis, const Complex& angle) {
  Eigen::Matrix3d cross;
  cross << 0, -axis.z(), axis.y(), axis.z(), 0, -axis.x(), -axis.y(), axis.x(), 0;
  return Matrix3::Identity() + Sin(angle) * cross.cast<Complex>() +
         (Complex(1) - Cos(angle)) * (cross * cross).cast<Complex>();
}

// The motion of a point or frame: velocity v = j q', acceleration j q'' + bias.
struct Motion {
  Jacobian j = Jacobian::Zero();
  Vector3 bias = Vector3::Zero();
};

// A frame that turns with `angular` (velocity `w`): the motion of a point of it at `r` from a point of it
// that moves with `origin`.
Motion MotionOfPoint(const Motion& origin, const Motion& angular, const Vector3& w, const Vector3& r) {
  Motion point = origin;
  for (int i = 0; i < kCoordinateCount; ++i) point.j.col(i) += Cross(angular.j.col(i), r);
  point.bias += Cross(angular.bias, r) + Cross(w, Cross(w, r));
  return point;
}

void AddBody(const RigidBody& body, const Matrix3& R_WL, const Vector3& w, const Motion& angular,
             const Motion& com, EquationsOfMotion& equations) {
  const Complex mass(body.mass_kg);
  const Matrix3 inertia = R_WL * body.inertia_kg_m2.cast<Complex>() * R_WL.transpose();
  const Vector3 gravity(Complex(0), Complex(0), Complex(-kGravity_m_s2));
  equations.mass += mass * com.j.transpose() * com.j + angular.j.transpose() * inertia * angular.j;
  equations.force += mass * com.j.transpose() * (gravity - com.bias) -
                     angular.j.transpose() * (inertia * angular.bias + Cross(w, inertia * w));
}

}  // namespace

EquationsOfMotion ComputeEquationsOfMotion(const VehicleModel& model, const Coordinates<Complex>& q,
                                           const Coordinates<Complex>& q_dot, const Inputs<Complex>& u) {
  EquationsOfMotion equations;
  equations.mass.setZero();
  equations.force.setZero();

  // Z-Y-X Euler angles: each rate turns about its own axis, which the angles after it in the chain carry
  // along.
  const Matrix3 R_z = Rotation(Eigen::Vector3d::UnitZ(), q[5]);
  const Matrix3 R_zy = R_z * Rotation(Eigen::Vector3d::UnitY(), q[4]);
  const Matrix3 R_WB = R_zy * Rotation(Eigen::Vector3d::UnitX(), q[3]);
  const Vector3 roll_axis = R_zy.col(0), pitch_axis = R_z.col(1), yaw_axis = Vector3::UnitZ();
  const Vector3 w_yaw = yaw_axis * q_dot[5];
  const Vector3 w_pitch = w_yaw + pitch_axis * q_dot[4];
  const Vector3 w_base = w_pitch + roll_axis * q_dot[3];

  Motion origin;
  origin.j.leftCols<3>().setIdentity();
  Motion base;
  base.j.col(3) = roll_axis;
  base.j.col(4) = pitch_axis;
  base.j.col(5) = yaw_axis;
  base.bias = Cross(w_pitch, roll_axis) * q_dot[3] + Cross(w_yaw, pitch_axis) * q_dot[4];
  const Vector3 base_com = R_WB * model.base.p_com_m.cast<Complex>();
  AddBody(model.base, R_WB, w_base, base, MotionOfPoint(origin, base, w_base, base_com), equations);

  for (std::size_t side = 0; side < model.thrusters.size(); ++side) {
    const TiltingThruster& thruster = model.thrusters[side];
    const int alpha = 6 + static_cast<int>(side);
    const Matrix3 R_WB_turned = R_WB * Rotation(thruster.axis_B, q[alpha]);
    const Matrix3 R_WT = R_WB_turned * thruster.R_BT.cast<Complex>();
    const Vector3 hinge_axis = R_WB * thruster.axis_B.cast<Complex>();
    const Vector3 w = w_base + hinge_axis * q_dot[alpha];
    Motion angular = base;
    angular.j.col(alpha) = hinge_axis;
    angular.bias += Cross(w_base, hinge_axis) * q_dot[alpha];

    const Vector3 to_hinge = R_WB * thruster.p_BH_m.cast<Complex>();
    const Eigen::Vector3d p_HC_B = thruster.p_BT_m + thruster.R_BT * thruster.body.p_com_m - thruster.p_BH_m;
    const Vector3 to_com = R_WB_turned * p_HC_B.cast<Complex>();
    const Motion hinge = MotionOfPoint(origin, base, w_base, to_hinge);
    const Motion com = MotionOfPoint(hinge, angular, w, to_com);
    AddBody(thruster.body, R_WT, w, angular, com, equations);

    const Vector3 thrust_axis = R_WT * thruster.thrust_axis_T.cast<Complex>();
    const Complex force = u[static_cast<int>(side)];
    equations.force += com.j.transpose() * thrust_axis * force;
    equations.force +=
        angular.j.transpose() * thrust_axis * (force * Complex(thruster.direction * thruster.drag_ratio_m));
    equations.force[alpha] += u[2 + static_cast<int>(side)];
  }
  return equations;
}

Coordinates<Complex> Acceleration(const VehicleModel& model, const Coordinates<Complex>& q,
                                  const Coordinates<Complex>& q_dot, const Inputs<Complex>& u) {
  const EquationsOfMotion equations = ComputeEquationsOfMotion(model, q, q_dot, u);
  return equations.mass.partialPivLu().solve(equations.force);
}

Hover SolveHover(const VehicleModel& model) {
  // At rest the mass matrix drops out: what is sought is generalised force zero, eight equations in
  // roll, pitch, alpha_r, alpha_l and the four inputs.
  using Vector = Eigen::Matrix<double, 8, 1>;
  const auto residual = [&model](const Eigen::Matrix<Complex, 8, 1>& unknowns) {
    Coordinates<Complex> q = Coordinates<Complex>::Zero();
    q[3] = unknowns[0];
    q[4] = unknowns[1];
    q[6] = unknowns[2];
    q[7] = unknowns[3];
    const Inputs<Complex> u = unknowns.tail<4>();
    return ComputeEquationsOfMotion(model, q, Coordinates<Complex>::Zero(), u).force;
  };
  Vector unknowns = Vector::Zero();
  unknowns[4] = unknowns[5] = 0.5 * model.MassTotal() * kGravity_m_s2;

  constexpr int kIterationsMax = 50;
  for (int iteration = 0; iteration < kIterationsMax; ++iteration) {
    const Vector value = residual(unknowns.cast<Complex>()).real();
    Eigen::Matrix<double, 8, 8> jacobian;
    for (int i = 0; i < 8; ++i) {
      Eigen::Matrix<Complex, 8, 1> moved = unknowns.cast<Complex>();
      moved[i] += Complex(0, kComplexStep);
      jacobian.col(i) = residual(moved).imag() / kComplexStep;
    }
    const Eigen::FullPivLU<Eigen::Matrix<double, 8, 8>> lu(jacobian);
    if (!lu.isInvertible()) break;
    const Vector step = lu.solve(value);
    unknowns -= step;
    if (!unknowns.allFinite()) break;
    if (step.cwiseAbs().maxCoeff() < 1e-14 * (1 + unknowns.cwiseAbs().maxCoeff())) {
      return {.roll_rad = unknowns[0],
              .pitch_rad = unknowns[1],
              .hinge_rad = {unknowns[2], unknowns[3]},
              .input = {unknowns[4], unknowns[5], unknowns[6], unknowns[7]}};
    }
  }
  throw DesignError("vehicle '" + model.name +
                    "' has no hover: its thrusters cannot hold it still in the air");
}

Coordinates<double> HoverCoordinates(const Hover& hover) {
  Coordinates<double> q;
  q << 0, 0, 0, hover.roll_rad, hover.pitch_rad, 0, hover.hinge_rad.at(0), hover.hinge_rad.at(1);
  return q;
}

Inputs<double> HoverInputs(const Hover& hover) {
  return {hover.input.at(0), hover.input.at(1), hover.input.at(2), hover.input.at(3)};
}

LinearModel Linearise(const VehicleModel& model, const Hover& hover) {
  const Coordinates<Complex> q = HoverCoordinates(hover).cast<Complex>();
  const Coordinates<Complex> q_dot = Coordinates<Complex>::Zero();
  const Inputs<Complex> u = HoverInputs(hover).cast<Complex>();
  const Complex step(0, kComplexStep);

  LinearModel linear;
  constexpr Eigen::Index kStateCount = Eigen::Index{2} * kCoordinateCount;
  linear.a.setZero(kStateCount, kStateCount);
  linear.b.setZero(kStateCount, kInputCount);
  linear.a.topRightCorner<kCoordinateCount, kCoordinateCount>().setIdentity();
  for (int i = 0; i < kCoordinateCount; ++i) {
    Coordinates<Complex> moved = q;
    moved[i] += step;
    linear.a.col(i).tail<kCoordinateCount>() = Acceleration(model, moved, q_dot, u).imag() / kComplexStep;
    moved = q_dot;
    moved[i] += step;
    linear.a.col(kCoordinateCount + i).tail<kCoordinateCount>() =
        Acceleration(model, q, moved, u).imag() / kComplexStep;
  }
  for (int i = 0; i < kInputCount; ++i) {
    Inputs<Complex> moved = u;
    moved[i] += step;
    linear.b.col(i).tail<kCoordinateCount>() = Acceleration(model, q, q_dot, moved).imag() / kComplexStep;
  }
  return linear;
}

}  // namespace tiltproof::plant
