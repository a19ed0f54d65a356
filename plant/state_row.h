// A row of states: the places of its values, and conversions of angular rates to other frames. Internal to
// the plant.
//
//   const StateLayout at(model.hinges.size());
//   Eigen::Vector3d v_WB = VectorAt(state, at.velocity);
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>

#include "plant/vehicle_model.h"

namespace tiltproof::plant {

// In the order of VehicleModel::signals: position, attitude, hinge angles, velocity, angular velocity, hinge
// rates. Each member is the index of its first number.
struct StateLayout {
  explicit StateLayout(std::size_t hinge_count)
      : velocity(hinges + hinge_count), rates(velocity + 3), hinge_rates(rates + 3) {}
  static constexpr std::size_t position = 0, attitude = 3, hinges = 6;
  std::size_t velocity, rates, hinge_rates;
};

// Three numbers of a row, from `first` on.
Eigen::Vector3d VectorAt(std::span<const double> row, std::size_t first);
void SetVector(std::span<double> row, std::size_t first, const Eigen::Vector3d& v);

// R_WB of Z-Y-X Euler angles (rad).
Eigen::Matrix3d FromEuler(double roll, double pitch, double yaw);

// Changes the angular rates of a row from the world's axes to the frame.
void ExpressRates(RatesFrame frame, const StateLayout& at, std::span<double> state);

}  // namespace tiltproof::plant
