// The firmware's data of the vehicle that it flies: the numbers of plant/models/tiltrotor.sdf (paper, Table
// 1). The constants that the equations of motion derive from them are computed at compile time.
//
//   constexpr VehicleConstants kVehicle = ComputeVehicleConstants(kTiltrotor);
//
// A test compares the numbers with the model file; after a change there, change them here.
//
// Frames: B main body, C the vehicle's centre of mass. SI units. Because each thruster's centre of mass is on
// its hinge, C does not move in B when the thrusters tilt.
#pragma once

#include <array>

#include "firmware/tolerant/vector3.h"

namespace tiltproof::firmware {

struct Thruster {
  double mass_kg = 0;
  std::array<double, 3> inertia_kg_m2{};  // xx, yy, zz about its centre of mass, which is on the hinge
  std::array<double, 3> p_BT_m{};         // its hinge in B
  double cant_rad = 0;                    // about the main body's x: tilts hinge and thrust
  double direction = 1;                   // sign of the drag torque about the thrust
};

struct VehicleParameters {
  double mass_kg = 0;                     // of the main body
  std::array<double, 3> p_com_m{};        // its centre of mass in B
  std::array<double, 6> inertia_kg_m2{};  // xx yy zz xy xz yz, about that
  std::array<Thruster, 2> thrusters{};    // right, left
  double drag_ratio_m = 0;                // propeller's drag torque per thrust
  double force_max_n = 0, torque_max_nm = 0,
         angle_max_rad = 0;  // of thrust, of the servo, stops of the hinge
};

inline constexpr VehicleParameters kTiltrotor = {
    .mass_kg = 1.92509767079622,
    .p_com_m = {-0.00254692194, 0.00013773408, -0.01819008141},
    .inertia_kg_m2 = {0.0697552757250878, 0.00792827006001647, 0.0664000187819483, 4.77417385357503e-05,
                      0.000362780890165671, -1.07360516340487e-05},
    .thrusters = {{{.mass_kg = 0.0809439719362664,
                    .inertia_kg_m2 = {3.88267747e-05, 1.04858690e-04, 8.31755565e-05},
                    .p_BT_m = {0.00002, -0.27761, 0.05621},
                    .cant_rad = -0.08726646259971647,
                    .direction = 1},
                   {.mass_kg = 0.080943968597,
                    .inertia_kg_m2 = {3.83153586e-05, 1.04858690e-04, 8.31755505e-05},
                    .p_BT_m = {0.00002, 0.27761, 0.05621},
                    .cant_rad = 0.08726646259971647,
                    .direction = -1}}},
    .drag_ratio_m = 0.0178947368,
    .force_max_n = 30,
    .torque_max_nm = 2,
    .angle_max_rad = 1.5};

// Constants of a thruster, in B.
struct ThrusterConstants {
  Vector3 arm_m;  // from C to the hinge
  float cant_sine = 0, cant_cosine = 1;
  float inertia_xx_kg_m2 = 0, inertia_yy_kg_m2 = 0, inertia_zz_kg_m2 = 0;
  float drag_ratio_m = 0;  // with its sign
};

struct VehicleConstants {
  float mass_kg = 0;  // of all
  Vector3 p_BC_m;
  Symmetric3 inertia_kg_m2;  // about C: the main body, and the thrusters as points; without their own inertia
  std::array<ThrusterConstants, 2> thrusters;
  float force_max_n = 0, torque_max_nm = 0, angle_max_rad = 0;
};

namespace detail {

// Series of sine and cosine, exact in binary64 for the few degrees of a cant.
constexpr double CantSine(double x) { return x - x * x * x / 6 + x * x * x * x * x / 120; }
constexpr double CantCosine(double x) {
  return 1 - x * x / 2 + x * x * x * x / 24 - x * x * x * x * x * x / 720;
}

// A point mass's inertia about the origin.
constexpr std::array<double, 6> PointInertia(double mass_kg, const std::array<double, 3>& p_m) {
  const auto [x, y, z] = p_m;
  return {mass_kg * (y * y + z * z), mass_kg * (x * x + z * z), mass_kg * (x * x + y * y),
          -mass_kg * x * y,          -mass_kg * x * z,          -mass_kg * y * z};
}

}  // namespace detail

constexpr VehicleConstants ComputeVehicleConstants(const VehicleParameters& vehicle) {
  const auto to_float = [](double value) { return static_cast<float>(value); };
  double mass_kg = vehicle.mass_kg;
  for (const Thruster& thruster : vehicle.thrusters) mass_kg += thruster.mass_kg;
  std::array<double, 3> p_BC_m{};
  for (unsigned axis = 0; axis < 3; ++axis) {
    p_BC_m[axis] = vehicle.mass_kg * vehicle.p_com_m[axis];
    for (const Thruster& thruster : vehicle.thrusters)
      p_BC_m[axis] += thruster.mass_kg * thruster.p_BT_m[axis];
    p_BC_m[axis] /= mass_kg;
  }
  const auto from_c = [&](const std::array<double, 3>& p_B) {
    return std::array<double, 3>{p_B[0] - p_BC_m[0], p_B[1] - p_BC_m[1], p_B[2] - p_BC_m[2]};
  };

  VehicleConstants constants;
  std::array<double, 6> inertia = vehicle.inertia_kg_m2;
  const auto add = [&](double mass, const std::array<double, 3>& p_CB) {
    const std::array<double, 6> point = detail::PointInertia(mass, p_CB);
    for (unsigned entry = 0; entry < 6; ++entry) inertia[entry] += point[entry];
  };
  add(vehicle.mass_kg, from_c(vehicle.p_com_m));
  for (unsigned i = 0; i < 2; ++i) {
    const Thruster& thruster = vehicle.thrusters[i];
    const std::array<double, 3> arm = from_c(thruster.p_BT_m);
    add(thruster.mass_kg, arm);
    constants.thrusters[i] = {.arm_m = {to_float(arm[0]), to_float(arm[1]), to_float(arm[2])},
                              .cant_sine = to_float(detail::CantSine(thruster.cant_rad)),
                              .cant_cosine = to_float(detail::CantCosine(thruster.cant_rad)),
                              .inertia_xx_kg_m2 = to_float(thruster.inertia_kg_m2[0]),
                              .inertia_yy_kg_m2 = to_float(thruster.inertia_kg_m2[1]),
                              .inertia_zz_kg_m2 = to_float(thruster.inertia_kg_m2[2]),
                              .drag_ratio_m = to_float(thruster.direction * vehicle.drag_ratio_m)};
  }
  constants.mass_kg = to_float(mass_kg);
  constants.p_BC_m = {to_float(p_BC_m[0]), to_float(p_BC_m[1]), to_float(p_BC_m[2])};
  constants.inertia_kg_m2 = {to_float(inertia[0]), to_float(inertia[1]), to_float(inertia[2]),
                             to_float(inertia[3]), to_float(inertia[4]), to_float(inertia[5])};
  constants.force_max_n = to_float(vehicle.force_max_n);
  constants.torque_max_nm = to_float(vehicle.torque_max_nm);
  constants.angle_max_rad = to_float(vehicle.angle_max_rad);
  return constants;
}

inline constexpr VehicleConstants kTiltrotorConstants = ComputeVehicleConstants(kTiltrotor);

}  // namespace tiltproof::firmware
