// The plant against an independent quadrotor: Newton's and Euler's equations of one rigid body with a quaternion, in
// Runge-Kutta steps of fourth order. It has no code of the plant, and no ODE. Both fly a path of 60 s, each with its own
// loop around the same controller.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

#include "plant/plant.h"
#include "tests/plant/models.h"
#include "tests/plant/rotor_vehicles.h"

namespace tiltproof::plant {
namespace {

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector4d;

// World position and velocity of the frame's origin, attitude, and body rates.
struct Motion {
  Vector3d p_m = Vector3d::Zero(), v_m_s = Vector3d::Zero(), w_B_rad_s = Vector3d::Zero();
  Matrix3d R = Matrix3d::Identity();
};

// The numbers of Quadrotor(), written out.
struct Numbers {
  double mass_kg = 1.2, drag_ratio_m = 0.016, force_max_n = 10;
  Vector3d com_m = {0.012, -0.007, -0.02};
  Matrix3d inertia_kg_m2;
  std::array<Vector3d, 4> rotors_m = {Vector3d(0.2, 0.15, 0.03), Vector3d(0.2, -0.15, 0.03),
                                      Vector3d(-0.2, 0.15, 0.03), Vector3d(-0.2, -0.15, 0.03)};
  std::array<double, 4> direction = {1, -1, -1, 1};
  Numbers() { inertia_kg_m2 << 0.012, 0.0004, -0.0007, 0.0004, 0.014, 0.0003, -0.0007, 0.0003, 0.021; }
};

class Oracle {
 public:
  Oracle(const Vector3d& p_m, const Vector4d& thrust_n, double up_s, double down_s)
      : thrust_n_(thrust_n), up_s_(up_s), down_s_(down_s) {
    state_ << p_m + numbers_.com_m, Vector3d::Zero(), 1, 0, 0, 0, Vector3d::Zero();
  }

  Motion Now() const {
    Motion motion;
    motion.R = Attitude(state_).toRotationMatrix();
    motion.w_B_rad_s = state_.tail<3>();
    motion.p_m = state_.head<3>() - motion.R * numbers_.com_m;
    motion.v_m_s = state_.segment<3>(3) - motion.R * motion.w_B_rad_s.cross(numbers_.com_m);
    return motion;
  }

  void Advance(const Vector4d& command_n, double time_s) {
    const Vector4d wanted_n = command_n.cwiseMax(0).cwiseMin(numbers_.force_max_n);
    const Vector4d from_n = thrust_n_;
    const auto thrust = [&](double t_s) {
      Vector4d f;
      for (int i = 0; i < 4; ++i) {
        const double lag_s = wanted_n[i] > from_n[i] ? up_s_ : down_s_;
        f[i] = lag_s > 0 ? wanted_n[i] + (from_n[i] - wanted_n[i]) * std::exp(-t_s / lag_s) : wanted_n[i];
      }
      return f;
    };
    constexpr int kSteps = 6;
    const double h = time_s / kSteps;
    for (int i = 0; i < kSteps; ++i) {
      const double t = i * h;
      const State k1 = Rate(state_, thrust(t)), k2 = Rate(state_ + h / 2 * k1, thrust(t + h / 2)),
                  k3 = Rate(state_ + h / 2 * k2, thrust(t + h / 2)),
                  k4 = Rate(state_ + h * k3, thrust(t + h));
      state_ += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
      state_.segment<4>(6).normalize();
    }
    thrust_n_ = thrust(time_s);
  }

 private:
  using State = Eigen::Matrix<double, 13, 1>;  // centre of mass, its velocity, quaternion w x y z, body rates
  static Quaterniond Attitude(const State& x) { return Quaterniond(x[6], x[7], x[8], x[9]).normalized(); }

  State Rate(const State& x, const Vector4d& f) const {
    Vector3d torque = Vector3d::Zero();
    for (std::size_t i = 0; i < 4; ++i) {
      const Vector3d thrust(0, 0, f[static_cast<int>(i)]);
      torque += (numbers_.rotors_m[i] - numbers_.com_m).cross(thrust) +
                numbers_.direction[i] * numbers_.drag_ratio_m * thrust;
    }
    const Vector3d w = x.tail<3>();
    const Quaterniond turning = Attitude(x) * Quaterniond(0, w.x(), w.y(), w.z());
    State rate;
    rate << x.segment<3>(3),
        Attitude(x) * Vector3d(0, 0, f.sum() / numbers_.mass_kg) - Vector3d(0, 0, kG_m_s2), 0.5 * turning.w(),
        0.5 * turning.vec(),
        numbers_.inertia_kg_m2.inverse() * (torque - w.cross(numbers_.inertia_kg_m2 * w));
    return rate;
  }

  Numbers numbers_;
  State state_;
  Vector4d thrust_n_;
  double up_s_, down_s_;
};

// A knot in space, with a heading that turns once.
struct PathPoint {
  Vector3d p_m, v_m_s, a_m_s2;
  double yaw_rad = 0;
};
PathPoint Path(double t) {
  const double w = 0.3, u = 0.6, h = 0.2;
  const double rise = 1 - std::exp(-t / 4), rise_rate = std::exp(-t / 4) / 4;
  const Vector3d s(3 * std::sin(w * t), 2 * std::sin(u * t), std::sin(h * t));
  const Vector3d s1(3 * w * std::cos(w * t), 2 * u * std::cos(u * t), h * std::cos(h * t));
  const Vector3d s2(-3 * w * w * std::sin(w * t), -2 * u * u * std::sin(u * t), -h * h * std::sin(h * t));
  return {Vector3d(0, 0, 5) + rise * s, rise_rate * s + rise * s1,
          -rise_rate / 4 * s + 2 * rise_rate * s1 + rise * s2, 0.1 * t};
}

// Thrusts of a cascade: acceleration, then attitude, then torques, for the rotors of Numbers.
Vector4d Control(const Motion& now, const PathPoint& at) {
  static const Numbers n;
  const Vector3d wanted =
      at.a_m_s2 + 4 * (at.p_m - now.p_m) + 3.2 * (at.v_m_s - now.v_m_s) + Vector3d(0, 0, kG_m_s2);
  const Vector3d z = wanted.normalized();
  const Vector3d y = z.cross(Vector3d(std::cos(at.yaw_rad), std::sin(at.yaw_rad), 0)).normalized();
  Matrix3d R;
  R << y.cross(z), y, z;
  const Matrix3d e = R.transpose() * now.R;
  const Vector3d error = 0.5 * Vector3d(e(2, 1) - e(1, 2), e(0, 2) - e(2, 0), e(1, 0) - e(0, 1));
  const Vector3d torque = n.inertia_kg_m2 * (-60 * error - 11 * now.w_B_rad_s);
  Eigen::Matrix4d mix;
  for (int i = 0; i < 4; ++i) {
    const Vector3d arm = n.rotors_m[static_cast<std::size_t>(i)] - n.com_m;
    mix.col(i) << 1, arm.y(), -arm.x(), n.direction[static_cast<std::size_t>(i)] * n.drag_ratio_m;
  }
  return mix.fullPivLu().solve(
      Vector4d(n.mass_kg * wanted.dot(now.R.col(2)), torque.x(), torque.y(), torque.z()));
}

Motion MotionOf(const Plant& plant) {
  std::array<double, 12> x{};
  plant.State(x, RatesFrame::kBody);
  Motion motion;
  motion.p_m = {x[0], x[1], x[2]};
  motion.R = (Eigen::AngleAxisd(x[5], Vector3d::UnitZ()) * Eigen::AngleAxisd(x[4], Vector3d::UnitY()) *
              Eigen::AngleAxisd(x[3], Vector3d::UnitX()))
                 .toRotationMatrix();
  motion.v_m_s = {x[6], x[7], x[8]};
  motion.w_B_rad_s = {x[9], x[10], x[11]};
  return motion;
}

struct Difference {
  double largest_m = 0, from_path_m = 0, tilt_rad = 0;
};
Difference FlyBoth(double up_s, double down_s, TimeNs step_ns) {
  VehicleModel model = Quadrotor();
  for (Rotor& rotor : model.rotors) {
    rotor.time_constant_up_s = up_s;
    rotor.time_constant_down_s = down_s;
  }
  Plant plant(model, {.step_ns = step_ns});
  plant.Reset({0, 0, 5}, {0, 0, 0});
  const std::vector<double>& hover = model.HoverInput();
  Oracle oracle({0, 0, 5}, Vector4d(hover[0], hover[1], hover[2], hover[3]), up_s, down_s);
  constexpr double kControl_s = 0.012;
  Difference difference;
  for (int k = 0; k < 5000; ++k) {
    const PathPoint at = Path(kControl_s * k);
    const Motion theirs = oracle.Now(), ours = MotionOf(plant);
    difference.largest_m = std::max(difference.largest_m, (ours.p_m - theirs.p_m).norm());
    if (k > 1000) difference.from_path_m = std::max(difference.from_path_m, (theirs.p_m - at.p_m).norm());
    difference.tilt_rad = std::max(difference.tilt_rad, std::acos(std::min(1.0, theirs.R(2, 2))));
    oracle.Advance(Control(theirs, at), kControl_s);
    const Vector4d command = Control(ours, at);
    for (TimeNs t = 0; t < 12 * kNsPerMs; t += step_ns) plant.Step({command.data(), 4});
    if (plant.Event() != FlightEvent::kNone) {
      ADD_FAILURE() << plant.EventText();
      break;
    }
  }
  return difference;
}

TEST(QuadrotorOracle, FliesAPathOf60sWithin5mm) {
  for (const auto& [up_s, down_s] : {std::pair{0.0, 0.0}, {0.0125, 0.025}}) {
    const Difference difference = FlyBoth(up_s, down_s, 4 * kNsPerMs);
    EXPECT_LE(difference.largest_m, 0.005) << "lag " << up_s;
    // It flies the path, and does not just hover.
    EXPECT_LT(difference.from_path_m, 0.5);
    EXPECT_GT(difference.tilt_rad, 0.05);
    RecordProperty("largest_difference_um_" + std::to_string(up_s > 0),
                   static_cast<int>(difference.largest_m * 1e6));
  }
}

// The difference is the plant's step: it shrinks with it.
TEST(QuadrotorOracle, ComesCloserWithAFinerStep) {
  EXPECT_LT(FlyBoth(0.0125, 0.025, kNsPerMs).largest_m, 0.4 * FlyBoth(0.0125, 0.025, 4 * kNsPerMs).largest_m);
}

}  // namespace
}  // namespace tiltproof::plant
