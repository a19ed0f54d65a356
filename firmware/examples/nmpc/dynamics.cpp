#include "firmware/examples/nmpc/dynamics.h"

#include <array>
#include <cstddef>

namespace tiltproof::nmpc {
namespace {

// A vector turned about a unit axis, by Rodrigues' formula.
template <class Scalar>
Eigen::Matrix<Scalar, 3, 1> Turned(const Eigen::Vector3d& axis, const Scalar& sine, const Scalar& cosine,
                                   const Eigen::Vector3d& vector) {
  const Eigen::Vector3d along = axis * axis.dot(vector), across = vector - along, side = axis.cross(vector);
  Eigen::Matrix<Scalar, 3, 1> turned;
  for (int i = 0; i < 3; ++i) turned[i] = along[i] + (cosine * across[i] + sine * side[i]);
  return turned;
}

template <class Scalar>
Eigen::Matrix<Scalar, 3, 1> Cross(const Eigen::Matrix<Scalar, 3, 1>& a,
                                  const Eigen::Matrix<Scalar, 3, 1>& b) {
  return {Scalar(a[1] * b[2] - a[2] * b[1]), Scalar(a[2] * b[0] - a[0] * b[2]),
          Scalar(a[0] * b[1] - a[1] * b[0])};
}
template <class Scalar>
Eigen::Matrix<Scalar, 3, 1> Times(const Eigen::Matrix3d& matrix, const Eigen::Matrix<Scalar, 3, 1>& v) {
  Eigen::Matrix<Scalar, 3, 1> product;
  for (int i = 0; i < 3; ++i) product[i] = matrix(i, 0) * v[0] + (matrix(i, 1) * v[1] + matrix(i, 2) * v[2]);
  return product;
}
template <class Scalar>
Scalar Dot(const Eigen::Matrix<Scalar, 3, 1>& a, const Eigen::Matrix<Scalar, 3, 1>& b) {
  return Scalar(a[0] * b[0] + (a[1] * b[1] + a[2] * b[2]));
}

Eigen::Matrix3d CrossMatrix(const Eigen::Vector3d& v) {
  Eigen::Matrix3d matrix;
  matrix << 0, -v[2], v[1], v[2], 0, -v[0], -v[1], v[0], 0;
  return matrix;
}

struct Attitude {
  double sin_roll, cos_roll, sin_pitch, cos_pitch;
  Eigen::Matrix3d R_x, R_zy;  // R_WB = R_zy R_x
  Eigen::Vector3d z_y;        // the axis of pitch, in the world

  template <class State>
  explicit Attitude(const State& x)
      : sin_roll(std::sin(x[3])),
        cos_roll(std::cos(x[3])),
        sin_pitch(std::sin(x[4])),
        cos_pitch(std::cos(x[4])) {
    const double sin_yaw = std::sin(x[5]), cos_yaw = std::cos(x[5]);
    R_x << 1, 0, 0, 0, cos_roll, -sin_roll, 0, sin_roll, cos_roll;
    R_zy << cos_yaw * cos_pitch, -sin_yaw, cos_yaw * sin_pitch, sin_yaw * cos_pitch, cos_yaw,
        sin_yaw * sin_pitch, -sin_pitch, 0, cos_pitch;
    z_y << -sin_yaw, cos_yaw, 0;
  }
};

}  // namespace

template <int kHinges, int kRotors>
template <class Scalar>
auto Dynamics<kHinges, kRotors>::Inverse(const Eigen::Matrix<Scalar, kMoving, 1>& moving,
                                         const Velocities& a) const -> Forces<Scalar> {
  using V = Vector3<Scalar>;
  const V w = moving.template segment<3>(kHinges);
  const Eigen::Vector3d linear = a.template head<3>(), angular = a.template segment<3>(3);
  Eigen::Matrix<Scalar, kN, 1> needed;
  V force = V::Zero(), moment = V::Zero();
  const auto add_body = [&](const Body& body, const V& p_com, const V& acceleration, const V& spin_torque) {
    const V inertial = Scalar(body.mass_kg) * acceleration;
    force += inertial;
    moment += Cross<Scalar>(p_com, inertial) + spin_torque;
  };
  {
    const V p = vehicle_.base.p_com_m.template cast<Scalar>();
    const V acceleration = linear.template cast<Scalar>() + angular.cross(vehicle_.base.p_com_m) +
                           Cross<Scalar>(w, Cross<Scalar>(w, p));
    const V momentum = Times<Scalar>(vehicle_.base.inertia_kg_m2, w);
    const V spin_torque =
        (vehicle_.base.inertia_kg_m2 * angular).template cast<Scalar>() + Cross<Scalar>(w, momentum);
    add_body(vehicle_.base, p, acceleration, spin_torque);
  }
  for (int i = 0; i < kHinges; ++i) {
    const TiltHinge& hinge = vehicle_.hinges[static_cast<std::size_t>(i)];
    using std::cos;
    using std::sin;
    const Scalar sine = sin(moving[i]), cosine = cos(moving[i]);
    const V axis = hinge.axis.template cast<Scalar>(), p_hinge = hinge.p_hinge_m.template cast<Scalar>();
    const V arm = Turned<Scalar>(hinge.axis, sine, cosine, hinge.body.p_com_m - hinge.p_hinge_m);
    const V turning = axis * moving[kHinges + 3 + i];  // of the hinge
    const V spin = w + turning;
    const V spin_rate = (angular + hinge.axis * a[6 + i]).template cast<Scalar>() + Cross<Scalar>(w, turning);
    const V at_hinge = (linear + angular.cross(hinge.p_hinge_m)).template cast<Scalar>() +
                       Cross<Scalar>(w, Cross<Scalar>(w, p_hinge));
    const V acceleration =
        at_hinge + Cross<Scalar>(spin_rate, arm) + Cross<Scalar>(spin, Cross<Scalar>(spin, arm));
    // The inertia turns with the hinge: I v = R (I_0 (R^T v)).
    const auto inertia_times = [&](const V& v) {
      V in_body = V::Zero();
      Eigen::Matrix<Scalar, 3, 3> rotation;
      for (int k = 0; k < 3; ++k)
        rotation.col(k) = Turned<Scalar>(hinge.axis, sine, cosine, Eigen::Vector3d::Unit(k));
      for (int k = 0; k < 3; ++k) in_body[k] = Dot<Scalar>(rotation.col(k), v);
      const V turned = Times<Scalar>(hinge.body.inertia_kg_m2, in_body);
      return V(rotation.col(0) * turned[0] + rotation.col(1) * turned[1] + rotation.col(2) * turned[2]);
    };
    const V spin_torque = inertia_times(spin_rate) + Cross<Scalar>(spin, inertia_times(spin));
    add_body(hinge.body, p_hinge + arm, acceleration, spin_torque);
    needed[6 + i] =
        Dot<Scalar>(axis, Cross<Scalar>(arm, V(Scalar(hinge.body.mass_kg) * acceleration)) + spin_torque);
  }
  needed.template head<3>() = force;
  needed.template segment<3>(3) = moment;
  return needed;
}

template <int kHinges, int kRotors>
typename Dynamics<kHinges, kRotors>::Mass Dynamics<kHinges, kRotors>::MassAt(const State& x) const {
  double mass = 0;
  Eigen::Vector3d first = Eigen::Vector3d::Zero();
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
  Mass matrix = Mass::Zero();
  const auto add_body = [&](double body_mass, const Eigen::Vector3d& p, const Eigen::Matrix3d& body_inertia) {
    mass += body_mass;
    first += body_mass * p;
    const Eigen::Matrix3d cross = CrossMatrix(p);
    inertia += body_inertia - body_mass * cross * cross;
  };
  add_body(vehicle_.base.mass_kg, vehicle_.base.p_com_m, vehicle_.base.inertia_kg_m2);
  for (int i = 0; i < kHinges; ++i) {
    const TiltHinge& hinge = vehicle_.hinges[static_cast<std::size_t>(i)];
    const double sine = std::sin(x[6 + i]), cosine = std::cos(x[6 + i]);
    Eigen::Matrix3d rotation;
    for (int k = 0; k < 3; ++k)
      rotation.col(k) = Turned<double>(hinge.axis, sine, cosine, Eigen::Vector3d::Unit(k));
    const Eigen::Matrix3d body_inertia = rotation * hinge.body.inertia_kg_m2 * rotation.transpose();
    const Eigen::Vector3d arm = rotation * (hinge.body.p_com_m - hinge.p_hinge_m), p = hinge.p_hinge_m + arm;
    const Eigen::Vector3d moved = hinge.axis.cross(arm), turned = body_inertia * hinge.axis;
    add_body(hinge.body.mass_kg, p, body_inertia);
    matrix.template block<3, 1>(0, 6 + i) = hinge.body.mass_kg * moved;
    matrix.template block<3, 1>(3, 6 + i) = turned + hinge.body.mass_kg * p.cross(moved);
    matrix.template block<1, 3>(6 + i, 0) = matrix.template block<3, 1>(0, 6 + i).transpose();
    matrix.template block<1, 3>(6 + i, 3) = matrix.template block<3, 1>(3, 6 + i).transpose();
    matrix(6 + i, 6 + i) = hinge.axis.dot(turned) + hinge.body.mass_kg * moved.squaredNorm();
  }
  matrix.template block<3, 3>(0, 0) = mass * Eigen::Matrix3d::Identity();
  matrix.template block<3, 3>(3, 0) = CrossMatrix(first);
  matrix.template block<3, 3>(0, 3) = -CrossMatrix(first);
  matrix.template block<3, 3>(3, 3) = inertia;
  return matrix;
}

template <int kHinges, int kRotors>
auto Dynamics<kHinges, kRotors>::InputMap(const State& x) const -> Map {
  Eigen::Matrix<double, kN, Size::kInputs> map;
  map.setZero();
  for (int i = 0; i < kRotors; ++i) {
    const Propeller& rotor = vehicle_.rotors[static_cast<std::size_t>(i)];
    Eigen::Vector3d axis = rotor.axis, p = rotor.p_rotor_m;
    if (rotor.hinge >= 0) {
      const TiltHinge& hinge = vehicle_.hinges[static_cast<std::size_t>(rotor.hinge)];
      const double sine = std::sin(x[6 + rotor.hinge]), cosine = std::cos(x[6 + rotor.hinge]);
      axis = Turned<double>(hinge.axis, sine, cosine, rotor.axis);
      const Eigen::Vector3d arm = Turned<double>(hinge.axis, sine, cosine, rotor.p_rotor_m - hinge.p_hinge_m);
      p = hinge.p_hinge_m + arm;
      map(6 + rotor.hinge, i) = hinge.axis.dot(arm.cross(axis) + rotor.drag_ratio_m * axis);
    }
    map.template block<3, 1>(0, i) = axis;
    map.template block<3, 1>(3, i) = p.cross(axis) + rotor.drag_ratio_m * axis;
  }
  for (int i = 0; i < kHinges; ++i) map(6 + i, kRotors + i) = 1;
  return map;
}

template <int kHinges, int kRotors>
typename Dynamics<kHinges, kRotors>::State Dynamics<kHinges, kRotors>::Rate(
    const State& x, const Input& u, const Disturbance& disturbance) const {
  const Attitude attitude(x);
  const Velocities at_rest = Velocities::Zero();
  const Velocities force = InputMap(x) * u - Inverse<double>(MovingOf(x), at_rest);
  const Velocities a = MassAt(x).llt().solve(force);
  const Eigen::Vector3d w = x.template segment<3>(9 + kHinges);
  const Eigen::Vector3d level =
      attitude.R_x * w;  // rates about the axes after roll: z is along the level one's
  State rate;
  rate.template head<3>() = x.template segment<3>(6 + kHinges);
  rate[5] = level[2] / attitude.cos_pitch;
  rate[4] = level[1];
  rate[3] = w[0] + rate[5] * attitude.sin_pitch;
  rate.template segment<kHinges>(6) = x.template tail<kHinges>();
  rate.template segment<3>(6 + kHinges) = attitude.R_zy * (attitude.R_x * a.template head<3>()) +
                                          disturbance.linear_m_s2 - Eigen::Vector3d(0, 0, kGravity_m_s2);
  rate.template segment<3>(9 + kHinges) = a.template segment<3>(3) + disturbance.angular_rad_s2;
  rate.template tail<kHinges>() = a.template tail<kHinges>();
  return rate;
}

template <int kHinges, int kRotors>
void Dynamics<kHinges, kRotors>::AddTurningThrusts(const State& x, const Input& u, const Map& map,
                                                   Slopes& sides) const {
  for (int i = 0; i < kRotors; ++i) {
    const Propeller& rotor = vehicle_.rotors[static_cast<std::size_t>(i)];
    if (rotor.hinge < 0) continue;
    // A turning hinge turns axis and arm.
    const TiltHinge& hinge = vehicle_.hinges[static_cast<std::size_t>(rotor.hinge)];
    const Eigen::Vector3d axis = map.template block<3, 1>(0, i), axis_turn = hinge.axis.cross(axis);
    const Eigen::Vector3d arm =
        Turned<double>(hinge.axis, std::sin(x[6 + rotor.hinge]), std::cos(x[6 + rotor.hinge]),
                       rotor.p_rotor_m - hinge.p_hinge_m);
    const Eigen::Vector3d torque_turn = hinge.axis.cross(arm).cross(axis) +
                                        (hinge.p_hinge_m + arm).cross(axis_turn) +
                                        rotor.drag_ratio_m * axis_turn;
    sides.template block<3, 1>(0, rotor.hinge) += u[i] * axis_turn;
    sides.template block<3, 1>(3, rotor.hinge) += u[i] * torque_turn;
    // About the hinge itself nothing changes: axis and arm keep their places relative to it.
  }
}

template <int kHinges, int kRotors>
Linearised<kHinges, kRotors> Dynamics<kHinges, kRotors>::Linearise(const State& x, const Input& u,
                                                                   const Disturbance& disturbance) const {
  constexpr int kV = 6 + kHinges, kW = 9 + kHinges;
  const Attitude attitude(x);
  const auto map = InputMap(x);
  const Eigen::LLT<Mass> mass(MassAt(x));
  const Velocities at_rest = Velocities::Zero();
  const auto moving = MovingOf(x);
  const Velocities a = mass.solve(map * u - Inverse<double>(moving, at_rest));

  // The forces of the motion and of the thrusts, differentiated at a constant acceleration.
  using Dual = Eigen::AutoDiffScalar<Eigen::Matrix<double, kMoving, 1>>;
  Eigen::Matrix<Dual, kMoving, 1> duals;
  for (int i = 0; i < kMoving; ++i) duals[i] = Dual(moving[i], kMoving, i);
  const Eigen::Matrix<Dual, kN, 1> needed = Inverse<Dual>(duals, a);
  Slopes sides;
  for (int row = 0; row < kN; ++row)
    sides.row(row).template head<kMoving>() = -needed[row].derivatives().transpose();
  sides.template rightCols<Size::kInputs>() = map;
  AddTurningThrusts(x, u, map, sides);
  const Slopes slopes = mass.solve(sides);

  Linearised<kHinges, kRotors> at;
  at.a.setZero();
  at.b.setZero();
  const Eigen::Vector3d w = x.template segment<3>(kW), level = attitude.R_x * w;
  const Eigen::Vector3d level_roll = Eigen::Vector3d::UnitX().cross(level);
  const double c = attitude.cos_pitch, s = attitude.sin_pitch, yaw_rate = level[2] / c;
  at.rate.template head<3>() = x.template segment<3>(kV);
  at.rate[5] = yaw_rate;
  at.rate[4] = level[1];
  at.rate[3] = w[0] + yaw_rate * s;
  at.rate.template segment<kHinges>(6) = x.template tail<kHinges>();
  const Eigen::Vector3d turned = attitude.R_x * a.template head<3>(), world = attitude.R_zy * turned;
  at.rate.template segment<3>(kV) = world + disturbance.linear_m_s2 - Eigen::Vector3d(0, 0, kGravity_m_s2);
  at.rate.template segment<3>(kW) = a.template segment<3>(3) + disturbance.angular_rad_s2;
  at.rate.template tail<kHinges>() = a.template tail<kHinges>();

  at.a.template block<3, 3>(0, kV).setIdentity();
  at.a.template block<kHinges, kHinges>(6, kW + 3).setIdentity();
  at.a(5, 3) = level_roll[2] / c;
  at.a(5, 4) = yaw_rate * s / c;
  at.a(4, 3) = level_roll[1];
  at.a(3, 3) = at.a(5, 3) * s;
  at.a(3, 4) = at.a(5, 4) * s + yaw_rate * c;
  at.a.template block<1, 3>(5, kW) = attitude.R_x.row(2) / c;
  at.a.template block<1, 3>(4, kW) = attitude.R_x.row(1);
  at.a.template block<1, 3>(3, kW) = at.a.template block<1, 3>(5, kW) * s;
  at.a(3, kW) += 1;
  at.a.template block<3, 1>(kV, 3) = attitude.R_zy * Eigen::Vector3d::UnitX().cross(turned);
  at.a.template block<3, 1>(kV, 4) = attitude.z_y.cross(world);
  at.a.template block<3, 1>(kV, 5) = Eigen::Vector3d::UnitZ().cross(world);
  const Eigen::Matrix<double, 3, Slopes::ColsAtCompileTime> linear =
      attitude.R_zy * (attitude.R_x * slopes.template topRows<3>());
  const auto put = [&](auto&& to, int column, int count) {
    to.middleRows(kV, 3) = linear.middleCols(column, count);
    to.middleRows(kW, 3 + kHinges) = slopes.middleRows(3, 3 + kHinges).middleCols(column, count);
  };
  put(at.a.middleCols(6, kHinges), 0, kHinges);
  put(at.a.middleCols(kW, 3 + kHinges), kHinges, 3 + kHinges);
  put(at.b.middleCols(0, Size::kInputs), kMoving, Size::kInputs);
  return at;
}

template <int kHinges, int kRotors>
typename Dynamics<kHinges, kRotors>::State Dynamics<kHinges, kRotors>::Advance(const State& x, const Input& u,
                                                                               const Disturbance& disturbance,
                                                                               double time_s) const {
  const State k1 = Rate(x, u, disturbance);
  const State k2 = Rate(x + 0.5 * time_s * k1, u, disturbance);
  const State k3 = Rate(x + 0.5 * time_s * k2, u, disturbance);
  const State k4 = Rate(x + time_s * k3, u, disturbance);
  return x + time_s / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
}

template <int kHinges, int kRotors>
Interval<kHinges, kRotors> Dynamics<kHinges, kRotors>::AdvanceLinearised(const State& x, const Input& u,
                                                                         const Disturbance& disturbance,
                                                                         double time_s) const {
  using Slope = Eigen::Matrix<double, Size::kStates, Size::kStates + Size::kInputs>;
  Slope sum = Slope::Zero(), last = Slope::Zero();
  State rates = State::Zero(), last_rate = State::Zero();
  constexpr std::array<double, 4> kReach = {0, 0.5, 0.5, 1}, kWeight = {1.0 / 6, 1.0 / 3, 1.0 / 3, 1.0 / 6};
  for (std::size_t stage = 0; stage < 4; ++stage) {
    const auto at = Linearise(x + kReach[stage] * time_s * last_rate, u, disturbance);
    Slope slope;
    slope.noalias() = at.a * last;
    slope *= kReach[stage] * time_s;
    slope.template leftCols<Size::kStates>() += at.a;
    slope.template rightCols<Size::kInputs>() += at.b;
    last = slope;
    last_rate = at.rate;
    sum += kWeight[stage] * last;
    rates += kWeight[stage] * last_rate;
  }
  Interval<kHinges, kRotors> interval;
  interval.end = x + time_s * rates;
  interval.a = time_s * sum.template leftCols<Size::kStates>();
  interval.a.diagonal().array() += 1;
  interval.b = time_s * sum.template rightCols<Size::kInputs>();
  return interval;
}

template class Dynamics<2, 2>;
template class Dynamics<0, 4>;

}  // namespace tiltproof::nmpc
