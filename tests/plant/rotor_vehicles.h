// Vehicles made in code: a quadrotor, a hexarotor, and vehicles with hinges. Statics by hand give their hovers.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <numbers>
#include <string>

#include "plant/dynamics.h"
#include "plant/vehicle_model.h"

namespace tiltproof::plant {

using Eigen::Vector3d;

inline constexpr double kG_m_s2 = 9.81;

inline Rotor RotorAt(const std::string& name, const Vector3d& p_m, double direction) {
  return {.name = name,
          .hinge = {},
          .p_LR_m = p_m,
          .direction = direction,
          .drag_ratio_m = 0.016,
          .force_min_n = 0,
          .force_max_n = 10};
}

inline VehicleModel Body(const std::string& name, double mass_kg, const Vector3d& p_com_m) {
  VehicleModel model;
  model.name = name;
  model.base.link = "body";
  model.base.mass_kg = mass_kg;
  model.base.p_com_m = p_com_m;
  model.base.inertia_kg_m2 << 0.012, 0.0004, -0.0007, 0.0004, 0.014, 0.0003, -0.0007, 0.0003, 0.021;
  model.collision.kind = CollisionShape::Kind::kSphere;
  model.collision.size_m = {0.2, 0, 0};
  return model;
}

// Arms of 0.2 m along x and 0.15 m along y.
inline VehicleModel Quadrotor(const Vector3d& p_com_m = {0.012, -0.007, -0.02}) {
  VehicleModel model = Body("quadrotor", 1.2, p_com_m);
  model.rotors = {RotorAt("front_left", {0.2, 0.15, 0.03}, 1), RotorAt("front_right", {0.2, -0.15, 0.03}, -1),
                  RotorAt("rear_left", {-0.2, 0.15, 0.03}, -1),
                  RotorAt("rear_right", {-0.2, -0.15, 0.03}, 1)};
  model.hover = SolveHover(model);
  return model;
}

inline constexpr double kHexarotorRadius_m = 0.3;
inline VehicleModel Hexarotor() {
  VehicleModel model = Body("hexarotor", 2.5, {0.015, 0.02, -0.03});
  for (int i = 0; i < 6; ++i) {
    const double angle = (30 + 60 * i) * std::numbers::pi / 180;
    model.rotors.push_back(
        RotorAt("m" + std::to_string(i),
                {kHexarotorRadius_m * std::cos(angle), kHexarotorRadius_m * std::sin(angle), 0.05},
                i % 2 == 0 ? 1 : -1));
  }
  model.hover = SolveHover(model);
  return model;
}

inline Hinge HingeAt(const std::string& name, const Vector3d& p_m) {
  Hinge hinge;
  hinge.name = name;
  hinge.joint = name + "_joint";
  hinge.body.link = name + "_body";
  hinge.body.mass_kg = 0.1;
  hinge.body.inertia_kg_m2 = Vector3d(4e-4, 5e-4, 6e-4).asDiagonal();
  hinge.p_BT_m = hinge.p_BH_m = p_m;
  hinge.axis_B = Vector3d::UnitY();
  hinge.angle_min_rad = -1;
  hinge.angle_max_rad = 1;
  hinge.torque_max_nm = 2;
  return hinge;
}

// Its centre of mass lies beside its hinges, which hover has to make up for.
inline constexpr double kHingeHeight_m = 0.08, kComX_m = 0.01, kComZ_m = -0.04;
inline VehicleModel Bicopter() {
  VehicleModel model = Body("bicopter", 1.5, {kComX_m, 0, kComZ_m});
  model.hinges = {HingeAt("a", {0, -0.25, kHingeHeight_m}), HingeAt("b", {0, 0.25, kHingeHeight_m})};
  model.rotors = {RotorAt("a", {0, 0, 0.05}, 1), RotorAt("b", {0, 0, 0.05}, -1)};
  for (std::size_t i = 0; i < 2; ++i) {
    model.rotors[i].hinge = i;
    model.rotors[i].force_max_n = 20;
  }
  model.hover = SolveHover(model);
  return model;
}

// One hinge with two rotors.
inline VehicleModel Boom() {
  VehicleModel model = Body("boom", 1.5, {kComX_m, 0, kComZ_m});
  model.hinges = {HingeAt("boom", {0, 0, kHingeHeight_m})};
  model.rotors = {RotorAt("r1", {0, -0.25, 0.05}, 1), RotorAt("r2", {0, 0.25, 0.05}, -1)};
  for (Rotor& rotor : model.rotors) {
    rotor.hinge = 0;
    rotor.force_max_n = 20;
  }
  model.hover = SolveHover(model);
  return model;
}

// A hinge with one rotor, and three rotors on the body.
inline VehicleModel Tricopter() {
  VehicleModel model = Body("tricopter", 1.4, {-0.01, 0.004, -0.01});
  model.hinges = {HingeAt("tail", {-0.3, 0.01, 0.02})};
  model.hinges[0].axis_B = Vector3d(1, 0.2, 0.1).normalized();
  model.hinges[0].body.p_com_m = {0.01, 0.02, 0.03};
  model.rotors = {RotorAt("nose", {0.2, 0.02, 0.03}, 1), RotorAt("tail", {0.01, 0.03, 0.06}, -1),
                  RotorAt("left", {0.1, 0.2, 0.03}, -1), RotorAt("right", {0.1, -0.2, 0.03}, 1)};
  model.rotors[0].thrust_axis_L = Vector3d(0.1, 0.05, 1).normalized();
  model.rotors[1].hinge = 0;
  model.hover = SolveHover(model);
  return model;
}

// Two rotors in front, and one behind on a hinge along x that balances the drag. The rotors push through the common
// centre of mass and at the hinge.
inline constexpr double kTailArm_m = 0.3, kFrontArm_m = 0.2, kFrontHalf_m = 0.25;
inline VehicleModel TailTricopter(ServoMode servo) {
  VehicleModel model = Body("tail_tricopter", 1.4, {0.1 * kTailArm_m / 1.4, 0, 0});
  model.hinges = {HingeAt("tail", {-kTailArm_m, 0, 0})};
  model.hinges[0].axis_B = Vector3d::UnitX();
  model.hinges[0].servo = servo;
  model.hinges[0].speed_max_rad_s = 6;
  model.hinges[0].time_constant_s = 0.04;
  model.rotors = {RotorAt("left", {kFrontArm_m, kFrontHalf_m, 0}, 1),
                  RotorAt("right", {kFrontArm_m, -kFrontHalf_m, 0}, -1), RotorAt("tail", {0, 0, 0}, 1)};
  model.rotors[2].hinge = 0;
  model.hover = SolveHover(model);
  return model;
}

// A rotor on each of four hinges along y, with the centre of mass `com_x_m` in front of their middle.
inline VehicleModel TiltQuadrotor(ServoMode servo, double com_x_m = 0) {
  VehicleModel model = Body("tilt_quadrotor", 1.6, {com_x_m, 0, -0.03});
  model.rotors = {RotorAt("front_left", {0, 0, 0}, 1), RotorAt("front_right", {0, 0, 0}, -1),
                  RotorAt("rear_left", {0, 0, 0}, -1), RotorAt("rear_right", {0, 0, 0}, 1)};
  for (std::size_t i = 0; i < 4; ++i) {
    Hinge hinge = HingeAt(model.rotors[i].name, {i < 2 ? 0.2 : -0.2, i % 2 == 0 ? 0.25 : -0.25, 0.02});
    hinge.servo = servo;
    hinge.speed_max_rad_s = 6;
    hinge.time_constant_s = 0.04;
    model.hinges.push_back(hinge);
    model.rotors[i].hinge = i;
  }
  model.hover = SolveHover(model);
  return model;
}

// Hinged bodies with hardly any inertia, whose servos turn them through their stops within one step of 4 ms.
inline VehicleModel LightBicopter() {
  VehicleModel model;
  model.name = "light_bicopter";
  model.base.link = "base";
  model.base.mass_kg = 0.4;
  model.base.inertia_kg_m2 = Vector3d(0.003, 0.001, 0.003).asDiagonal();
  model.collision.kind = CollisionShape::Kind::kSphere;
  model.collision.size_m = {0.1, 0, 0};
  model.hinges = {HingeAt("right", {0, -0.11, 0.12}), HingeAt("left", {0, 0.11, 0.12})};
  model.hinges[0].body.inertia_kg_m2 = Vector3d(5e-6, 5e-6, 5e-6).asDiagonal();
  model.hinges[1].body.inertia_kg_m2 = Vector3d(5e-6, 5e-7, 5e-6).asDiagonal();
  model.rotors = {RotorAt("right", {0, 0, 0}, 1), RotorAt("left", {0, 0, 0}, -1)};
  for (std::size_t i = 0; i < 2; ++i) {
    model.hinges[i].angle_min_rad = -0.785;
    model.hinges[i].angle_max_rad = 0.785;
    model.hinges[i].torque_max_nm = 0.2;
    model.rotors[i].hinge = i;
  }
  model.hover = SolveHover(model);
  return model;
}

}  // namespace tiltproof::plant
