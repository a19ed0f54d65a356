// Shipped vehicles as the controller knows them, from the plant's own model.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "firmware/examples/nmpc/rotorcraft.h"
#include "plant/dynamics.h"
#include "plant/vehicle_model.h"

namespace tiltproof::nmpc {

inline plant::VehicleModel ShippedModel(const std::string& name) {
  std::vector<std::string> warnings;
  return plant::LoadVehicle(std::filesystem::path(TILTPROOF_SOURCE_DIR) / "plant/models" / (name + ".sdf"),
                            {}, warnings);
}

inline Rotorcraft VehicleOf(const plant::VehicleModel& model) {
  const auto body = [](const plant::RigidBody& from, const Eigen::Matrix3d& R, const Eigen::Vector3d& p) {
    return Body{.mass_kg = from.mass_kg,
                .p_com_m = p + R * from.p_com_m,
                .inertia_kg_m2 = R * from.inertia_kg_m2 * R.transpose()};
  };
  Rotorcraft vehicle;
  vehicle.base = body(model.base, Eigen::Matrix3d::Identity(), Eigen::Vector3d::Zero());
  for (const plant::Hinge& hinge : model.hinges)
    vehicle.hinges.push_back({.body = body(hinge.body, hinge.R_BT, hinge.p_BT_m),
                              .p_hinge_m = hinge.p_BH_m,
                              .axis = hinge.axis_B,
                              .angle_min_rad = hinge.angle_min_rad,
                              .angle_max_rad = hinge.angle_max_rad});
  for (const plant::Rotor& rotor : model.rotors) {
    Propeller propeller = {.hinge = rotor.hinge ? static_cast<int>(*rotor.hinge) : -1,
                           .p_rotor_m = rotor.p_LR_m,
                           .axis = rotor.thrust_axis_L,
                           .drag_ratio_m = rotor.direction * rotor.drag_ratio_m};
    if (rotor.hinge) {
      const plant::Hinge& hinge = model.hinges[*rotor.hinge];
      propeller.p_rotor_m = hinge.p_BT_m + hinge.R_BT * rotor.p_LR_m;
      propeller.axis = hinge.R_BT * rotor.thrust_axis_L;
    }
    vehicle.rotors.push_back(propeller);
  }
  vehicle.input_min = model.InputMin();
  vehicle.input_max = model.InputMax();
  vehicle.input_hover = model.HoverInput();
  vehicle.roll_hover_rad = model.hover.roll_rad;
  vehicle.pitch_hover_rad = model.hover.pitch_rad;
  vehicle.hinge_hover_rad = model.hover.hinge_rad;
  return vehicle;
}

}  // namespace tiltproof::nmpc
