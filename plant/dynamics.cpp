#include "plant/dynamics.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace tiltproof::plant {
namespace {

using Vector3 = Eigen::Matrix<Complex, 3, 1>;
using Matrix3 = Eigen::Matrix<Complex, 3, 3>;
using Jacobian = Eigen::Matrix<Complex, 3, Eigen::Dynamic, Eigen::ColMajor, 3, kCoordinatesMax>;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kComplexStep = 1e-30;

// The time in which the rate of a position servo follows in the equations, and the shortest lag of its angle. The plant
// lets the rate jump, which leaves no alpha'' to the equations.
constexpr double kServoRise_s = 0.002;

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
  explicit Motion(Index coordinate_count) : j(Jacobian::Zero(3, coordinate_count)) {}
  Jacobian j;
  Vector3 bias = Vector3::Zero();
};

// A frame that turns with `angular` (velocity `w`): the motion of a point of it at `r` from a point of it
// that moves with `origin`.
Motion MotionOfPoint(const Motion& origin, const Motion& angular, const Vector3& w, const Vector3& r) {
  Motion point = origin;
  for (Index i = 0; i < point.j.cols(); ++i) point.j.col(i) += Cross(angular.j.col(i), r);
  point.bias += Cross(angular.bias, r) + Cross(w, Cross(w, r));
  return point;
}

// Eigen's products of matrices without a fixed size take long to compile.
template <class A, class B>
Complex Dot(const A& a, const B& b) {
  return a[0] * b[0] + (a[1] * b[1] + a[2] * b[2]);
}

void AddBody(const RigidBody& body, const Matrix3& R_WL, const Vector3& w, const Motion& angular,
             const Motion& com, EquationsOfMotion& equations) {
  const Complex mass(body.mass_kg);
  const Matrix3 inertia = R_WL * body.inertia_kg_m2.cast<Complex>() * R_WL.transpose();
  const Vector3 gravity(Complex(0), Complex(0), Complex(-kGravity_m_s2));
  const Vector3 force = gravity - com.bias, torque = inertia * angular.bias + Cross(w, inertia * w);
  for (Index i = 0; i < equations.force.size(); ++i) {
    const Vector3 com_j = com.j.col(i), mass_j = mass * com_j, angular_j = angular.j.col(i);
    Vector3 inertia_j;
    for (int k = 0; k < 3; ++k) inertia_j[k] = Dot(angular_j, inertia.col(k));
    equations.force[i] += Dot(mass_j, force) - Dot(angular_j, torque);
    for (Index k = 0; k < equations.force.size(); ++k) {
      const Vector3 terms = inertia_j.cwiseProduct(angular.j.col(k));
      equations.mass(i, k) += mass * Dot(com_j, com.j.col(k)) + (terms[0] + terms[1] + terms[2]);
    }
  }
}

// The rotor on the body L, whose centre of mass moves with `com`.
void AddRotor(const Rotor& rotor, const RigidBody& body, const Matrix3& R_WL, const Vector3& w,
              const Motion& angular, const Motion& com, const Complex& force, EquationsOfMotion& equations) {
  const Vector3 thrust_axis = R_WL * rotor.thrust_axis_L.cast<Complex>();
  const Eigen::Vector3d p_CR_L = rotor.p_LR_m - body.p_com_m;
  const Motion point = p_CR_L.isZero(0) ? com : MotionOfPoint(com, angular, w, R_WL * p_CR_L.cast<Complex>());
  const Complex drag = force * Complex(rotor.direction * rotor.drag_ratio_m);
  for (Index i = 0; i < equations.force.size(); ++i) {
    equations.force[i] += Dot(point.j.col(i), thrust_axis) * force;
    equations.force[i] += Dot(angular.j.col(i), thrust_axis) * drag;
  }
}

// Sum of row(j) x(j) over `count` places from `first` on, in halves.
template <class Row>
Complex RowTimes(const Row& row, const Coordinates<Complex>& x, Index first, Index count) {
  if (count == 1) return row(first) * x[first];
  const Index half = count / 2;
  return RowTimes(row, x, first, half) + RowTimes(row, x, first + half, count - half);
}

// Turns the force into mass^-1 force by Gaussian elimination with row pivots. Eigen's own decomposition takes long to
// compile for matrices without a fixed size.
void SolveInPlace(EquationsOfMotion& equations) {
  auto& m = equations.mass;
  auto& x = equations.force;
  const Index n = x.size();
  for (Index k = 0; k < n; ++k) {
    Index pivot = k;
    for (Index i = k + 1; i < n; ++i)
      if (std::abs(m(i, k)) > std::abs(m(pivot, k))) pivot = i;
    for (Index j = 0; j < n; ++j) std::swap(m(k, j), m(pivot, j));
    std::swap(x[k], x[pivot]);
    const Complex inverse_of = std::conj(m(k, k));
    const double square = std::norm(m(k, k));
    for (Index i = k + 1; i < n; ++i) {
      const Complex scaled = m(i, k) * inverse_of;
      m(i, k) = {scaled.real() / square, scaled.imag() / square};
      for (Index j = k + 1; j < n; ++j) m(i, j) -= m(i, k) * m(k, j);
    }
  }
  for (Index i = 1; i < n; ++i) x[i] -= RowTimes(m.row(i), x, 0, i);
  for (Index i = n; i-- > 0;) {
    if (i + 1 < n) x[i] -= RowTimes(m.row(i), x, i + 1, n - i - 1);
    x[i] /= m(i, i);
  }
}

}  // namespace

EquationsOfMotion ComputeEquationsOfMotion(const VehicleModel& model, const Coordinates<Complex>& q,
                                           const Coordinates<Complex>& q_dot, const Inputs<Complex>& u) {
  const Index n = CoordinateCount(model), rotor_count = static_cast<Index>(model.rotors.size());
  EquationsOfMotion equations;
  equations.mass.setZero(n, n);
  equations.force.setZero(n);

  // Z-Y-X Euler angles: each rate turns about its own axis, which the angles after it in the chain carry
  // along.
  const Matrix3 R_z = Rotation(Eigen::Vector3d::UnitZ(), q[5]);
  const Matrix3 R_zy = R_z * Rotation(Eigen::Vector3d::UnitY(), q[4]);
  const Matrix3 R_WB = R_zy * Rotation(Eigen::Vector3d::UnitX(), q[3]);
  const Vector3 roll_axis = R_zy.col(0), pitch_axis = R_z.col(1), yaw_axis = Vector3::UnitZ();
  const Vector3 w_yaw = yaw_axis * q_dot[5];
  const Vector3 w_pitch = w_yaw + pitch_axis * q_dot[4];
  const Vector3 w_base = w_pitch + roll_axis * q_dot[3];

  Motion origin(n);
  origin.j.leftCols<3>().setIdentity();
  Motion base(n);
  base.j.col(3) = roll_axis;
  base.j.col(4) = pitch_axis;
  base.j.col(5) = yaw_axis;
  base.bias = Cross(w_pitch, roll_axis) * q_dot[3] + Cross(w_yaw, pitch_axis) * q_dot[4];
  // `hinge`: the body's; none: the main body.
  const auto add_rotors = [&](std::optional<std::size_t> hinge, const RigidBody& body, const Matrix3& R_WL,
                              const Vector3& w, const Motion& angular, const Motion& com) {
    for (Index i = 0; i < rotor_count; ++i)
      if (const Rotor& rotor = model.rotors[static_cast<std::size_t>(i)]; rotor.hinge == hinge)
        AddRotor(rotor, body, R_WL, w, angular, com, u[i], equations);
  };
  const Vector3 to_base_com = R_WB * model.base.p_com_m.cast<Complex>();
  const Motion base_com = MotionOfPoint(origin, base, w_base, to_base_com);
  AddBody(model.base, R_WB, w_base, base, base_com, equations);
  add_rotors(std::nullopt, model.base, R_WB, w_base, base, base_com);

  for (std::size_t i = 0; i < model.hinges.size(); ++i) {
    const Hinge& hinge = model.hinges[i];
    const Index alpha = 6 + static_cast<Index>(i);
    const Matrix3 R_WB_turned = R_WB * Rotation(hinge.axis_B, q[alpha]);
    const Matrix3 R_WT = R_WB_turned * hinge.R_BT.cast<Complex>();
    const Vector3 hinge_axis = R_WB * hinge.axis_B.cast<Complex>();
    const Vector3 w = w_base + hinge_axis * q_dot[alpha];
    Motion angular = base;
    angular.j.col(alpha) = hinge_axis;
    angular.bias += Cross(w_base, hinge_axis) * q_dot[alpha];

    const Vector3 to_hinge = R_WB * hinge.p_BH_m.cast<Complex>();
    const Eigen::Vector3d p_HC_B = hinge.p_BT_m + hinge.R_BT * hinge.body.p_com_m - hinge.p_BH_m;
    const Vector3 to_com = R_WB_turned * p_HC_B.cast<Complex>();
    const Motion com = MotionOfPoint(MotionOfPoint(origin, base, w_base, to_hinge), angular, w, to_com);
    AddBody(hinge.body, R_WT, w, angular, com, equations);
    add_rotors(i, hinge.body, R_WT, w, angular, com);
    if (hinge.servo == ServoMode::kTorque) equations.force[alpha] += u[rotor_count + static_cast<Index>(i)];
  }
  for (std::size_t i = 0; i < model.hinges.size(); ++i) {
    if (model.hinges[i].servo != ServoMode::kPosition) continue;
    const Index alpha = 6 + static_cast<Index>(i);
    const double lag_s = std::max(model.hinges[i].time_constant_s, kServoRise_s);
    for (Index k = 0; k < n; ++k) equations.mass(alpha, k) = 0;
    equations.mass(alpha, alpha) = lag_s * kServoRise_s;
    equations.force[alpha] = u[rotor_count + static_cast<Index>(i)] - q[alpha];
    equations.force[alpha] -= (lag_s + kServoRise_s) * q_dot[alpha];
  }
  return equations;
}

Coordinates<Complex> Acceleration(const VehicleModel& model, const Coordinates<Complex>& q,
                                  const Coordinates<Complex>& q_dot, const Inputs<Complex>& u) {
  EquationsOfMotion equations = ComputeEquationsOfMotion(model, q, q_dot, u);
  SolveInPlace(equations);
  return equations.force;
}

namespace {

// Hover as equations: at rest the mass matrix drops out, and the generalised forces must be zero. The unknowns
// are roll, pitch, the hinge angles and the inputs.
class HoverEquations {
 public:
  explicit HoverEquations(const VehicleModel& model)
      : model_(model), hinge_count_(static_cast<Index>(model.hinges.size())) {}

  Index unknown_count() const { return 2 + hinge_count_ + InputCount(model_); }

  // Level, with the weight shared by all rotors.
  VectorXd Start() const {
    VectorXd unknowns = VectorXd::Zero(unknown_count());
    const auto rotor_count = static_cast<Index>(model_.rotors.size());
    unknowns.segment(2 + hinge_count_, rotor_count)
        .setConstant(1.0 / static_cast<double>(rotor_count) * model_.MassTotal() * kGravity_m_s2);
    return unknowns;
  }

  // The unit of each unknown in the sum of squares that picks one hover of many.
  VectorXd Scale() const {
    constexpr double kAngle_rad = 0.1;
    VectorXd scale = VectorXd::Constant(unknown_count(), kAngle_rad);
    const std::vector<double> min = model_.InputMin(), max = model_.InputMax();
    for (std::size_t i = 0; i < max.size(); ++i) {
      const double limit = std::max(std::abs(min[i]), std::abs(max[i]));
      scale[2 + hinge_count_ + static_cast<Index>(i)] = limit > 0 ? limit : 1;
    }
    return scale;
  }

  VectorXd Residual(const VectorXd& unknowns) const { return Forces(unknowns.cast<Complex>()).real(); }

  MatrixXd Jacobian(const VectorXd& unknowns) const {
    MatrixXd jacobian(CoordinateCount(model_), unknown_count());
    for (Index i = 0; i < unknown_count(); ++i) {
      Eigen::VectorXcd moved = unknowns.cast<Complex>();
      moved[i] += Complex(0, kComplexStep);
      jacobian.col(i) = Forces(moved).imag() / kComplexStep;
    }
    return jacobian;
  }

  Hover ToHover(const VectorXd& unknowns) const {
    const auto row = [&](Index first, Index count) {
      return std::vector<double>(unknowns.data() + first, unknowns.data() + first + count);
    };
    return {.roll_rad = unknowns[0],
            .pitch_rad = unknowns[1],
            .hinge_rad = row(2, hinge_count_),
            .input = row(2 + hinge_count_, InputCount(model_))};
  }

 private:
  Coordinates<Complex> Forces(const Eigen::VectorXcd& unknowns) const {
    const Index n = CoordinateCount(model_);
    Coordinates<Complex> q = Coordinates<Complex>::Zero(n);
    q.segment(3, 2) = unknowns.head(2);
    q.tail(hinge_count_) = unknowns.segment(2, hinge_count_);
    const Inputs<Complex> u = unknowns.tail(InputCount(model_));
    return ComputeEquationsOfMotion(model_, q, Coordinates<Complex>::Zero(n), u).force;
  }

  const VehicleModel& model_;
  Index hinge_count_;
};

// The smallest x with the smallest |a x - b|: the pseudo-inverse. Jacobi's rotations make the rows orthogonal.
VectorXd SmallestSolution(MatrixXd a, VectorXd b) {
  constexpr int kSweepsMax = 60;
  constexpr double kOrthogonal = 1e-15, kRank = 1e-9;
  bool rotated = true;
  for (int sweep = 0; sweep < kSweepsMax && rotated; ++sweep) {
    rotated = false;
    for (Index i = 0; i < a.rows(); ++i) {
      for (Index k = i + 1; k < a.rows(); ++k) {
        const double ii = a.row(i).squaredNorm(), kk = a.row(k).squaredNorm(), ik = a.row(i).dot(a.row(k));
        if (std::abs(ik) <= kOrthogonal * std::sqrt(ii * kk)) continue;
        rotated = true;
        const double angle = 0.5 * std::atan2(2 * ik, ii - kk), c = std::cos(angle), s = std::sin(angle);
        const VectorXd upper = a.row(i);
        a.row(i) = c * upper.transpose() + s * a.row(k);
        a.row(k) = c * a.row(k) - s * upper.transpose();
        const double above = b[i];
        b[i] = c * above + s * b[k];
        b[k] = c * b[k] - s * above;
      }
    }
  }
  const double largest = a.rowwise().norm().maxCoeff();
  VectorXd x = VectorXd::Zero(a.cols());
  for (Index i = 0; i < a.rows(); ++i)
    if (const double norm = a.row(i).norm(); norm > kRank * largest)
      x += a.row(i).transpose() * (b[i] / (norm * norm));
  return x;
}

// Newton's step to the zero of `value` at which the unknowns are smallest in units of `scale`. Where the equations
// contradict each other it goes for the smallest residual.
VectorXd SmallestStep(const VectorXd& unknowns, const VectorXd& value, const MatrixXd& jacobian,
                      const VectorXd& scale) {
  const VectorXd right = jacobian * unknowns - value;
  return unknowns - scale.cwiseProduct(SmallestSolution(jacobian * scale.asDiagonal(), right));
}

}  // namespace

Hover SolveHover(const VehicleModel& model) {
  const HoverEquations equations(model);
  VectorXd unknowns = equations.Start();
  const VectorXd scale = equations.Scale();
  const double residual_max = 1e-9 * model.MassTotal() * kGravity_m_s2;

  constexpr int kIterationsMax = 50;
  for (int iteration = 0; iteration < kIterationsMax; ++iteration) {
    const VectorXd value = equations.Residual(unknowns);
    const MatrixXd jacobian = equations.Jacobian(unknowns);
    VectorXd step;
    double step_max = 1e-14;  // relative
    if (jacobian.rows() == jacobian.cols()) {
      const Eigen::FullPivLU<MatrixXd> lu(jacobian);
      if (lu.isInvertible()) step = lu.solve(value);
    }
    if (step.size() == 0) {
      step = SmallestStep(unknowns, value, jacobian, scale);
      step_max = 1e-12;
    }
    unknowns -= step;
    if (!unknowns.allFinite()) break;
    if (step.cwiseAbs().maxCoeff() > step_max * (1 + unknowns.cwiseAbs().maxCoeff())) continue;
    // Equations that contradict each other leave a rest.
    if (equations.Residual(unknowns).cwiseAbs().maxCoeff() > residual_max) break;
    return equations.ToHover(unknowns);
  }
  throw DesignError("vehicle '" + model.name + "' has no hover: its rotors cannot hold it still in the air");
}

Coordinates<double> HoverCoordinates(const Hover& hover) {
  Coordinates<double> q = Coordinates<double>::Zero(6 + static_cast<Index>(hover.hinge_rad.size()));
  q[3] = hover.roll_rad;
  q[4] = hover.pitch_rad;
  for (std::size_t i = 0; i < hover.hinge_rad.size(); ++i) q[6 + static_cast<Index>(i)] = hover.hinge_rad[i];
  return q;
}

Inputs<double> HoverInputs(const Hover& hover) {
  Inputs<double> u(static_cast<Index>(hover.input.size()));
  for (std::size_t i = 0; i < hover.input.size(); ++i) u[static_cast<Index>(i)] = hover.input[i];
  return u;
}

LinearModel Linearise(const VehicleModel& model, const Hover& hover) {
  const Index n = CoordinateCount(model), input_count = InputCount(model);
  const Coordinates<Complex> q = HoverCoordinates(hover).cast<Complex>();
  const Coordinates<Complex> q_dot = Coordinates<Complex>::Zero(n);
  const Inputs<Complex> u = HoverInputs(hover).cast<Complex>();
  const Complex step(0, kComplexStep);

  LinearModel linear;
  linear.a.setZero(2 * n, 2 * n);
  linear.b.setZero(2 * n, input_count);
  linear.a.topRightCorner(n, n).setIdentity();
  for (Index i = 0; i < n; ++i) {
    Coordinates<Complex> moved = q;
    moved[i] += step;
    linear.a.col(i).tail(n) = Acceleration(model, moved, q_dot, u).imag() / kComplexStep;
    moved = q_dot;
    moved[i] += step;
    linear.a.col(n + i).tail(n) = Acceleration(model, q, moved, u).imag() / kComplexStep;
  }
  for (Index i = 0; i < input_count; ++i) {
    Inputs<Complex> moved = u;
    moved[i] += step;
    linear.b.col(i).tail(n) = Acceleration(model, q, q_dot, moved).imag() / kComplexStep;
  }
  return linear;
}

}  // namespace tiltproof::plant
