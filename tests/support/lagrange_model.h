// A second model of the vehicle, to judge the plant by: Lagrange's equations, no physics engine, nothing
// shared with plant/.
//
// Its kinetic energy is written with homogeneous transforms alone: a body with transform T(q) (4 x 4) and
// pseudo-inertia J (4 x 4, the integral of r r' dm over points r = (x y z 1)) has K = 1/2 tr(T' J T'^T), and
// Lagrange's equations become
//   sum over bodies of tr(dT/dq_i J T''^T) = Q_i.
// No angular velocity, no cross product, no Jacobian of the other formulation appears.
//
// Parameters are numbers of the paper and of the published model, not read through the product.
#pragma once

#include <Eigen/Core>
#include <array>

#include "firmware/signals.h"

namespace tiltproof::testing {

struct LagrangeParameters {
  struct Body {
    double mass_kg;
    Eigen::Vector3d com_m;          // in the body's frame
    Eigen::Matrix3d inertia_kg_m2;  // about the centre of mass
  };
  Body base;
  std::array<Body, 2> thrusters;           // right, left
  std::array<Eigen::Vector3d, 2> hinge_m;  // thruster frame's origin in the base frame
  std::array<double, 2> tilt_rad;          // the thruster's frame is rolled by this
  bool hinge_axis_tilted;  // hinge about the thruster's y axis (design plant) or the base's (as published)
  double drag_ratio_m;
};
LagrangeParameters DesignPlant();
LagrangeParameters PublishedPlant();  // with the paper's Ixx of the right thruster

class LagrangeModel {
 public:
  using Vector8 = Eigen::Matrix<double, 8, 1>;

  explicit LagrangeModel(const LagrangeParameters& parameters);

  // q'' for q = (x y z roll pitch yaw alpha_r alpha_l) and the input; no stops, no ground, no saturation.
  Vector8 Acceleration(const Vector8& q, const Vector8& q_dot, const ActuatorsTruth& u) const;

  // State with Euler rates in q_dot.
  struct State {
    Vector8 q = Vector8::Zero(), q_dot = Vector8::Zero();
  };
  // Classical Runge-Kutta, fourth order.
  void Advance(const ActuatorsTruth& u, double step_s, State& state) const;

  // Kinetic plus potential energy (J).
  double Energy(const State& state) const;

 private:
  LagrangeParameters parameters_;
  std::array<Eigen::Matrix4d, 3> pseudo_inertia_;  // base, right, left
};

// Yaw in (-pi, pi]. Angular rates along the world's axes, or the derivatives of roll, pitch, yaw.
SensorsTruth ToSensors(const LagrangeModel::State& state);
SensorsTruth ToSensorsWithEulerRates(const LagrangeModel::State& state);

}  // namespace tiltproof::testing
