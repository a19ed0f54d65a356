// The vehicles of the tests, and numbers for them.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <random>
#include <string>
#include <vector>

#include "plant/vehicle_model.h"

namespace tiltproof::plant {

inline std::filesystem::path SourceFile(const std::string& path) {
  return std::filesystem::path(TILTPROOF_SOURCE_DIR) / path;
}

// A vehicle that ships: loads without a warning.
inline VehicleModel LoadShipped(const std::string& name) {
  std::vector<std::string> warnings;
  VehicleModel model = LoadVehicle(SourceFile("plant/models/" + name + ".sdf"), {}, warnings);
  EXPECT_EQ(warnings, std::vector<std::string>());
  return model;
}

// The vehicle of the shipped scenarios.
inline const VehicleModel& Model() {
  static const VehicleModel model = LoadShipped("tiltrotor");
  return model;
}

// Uniform in [-bound, bound]; the standard's distributions differ between libraries.
inline double Draw(std::mt19937_64& generator, double bound) {
  return bound * (2 * std::ldexp(static_cast<double>(generator() >> 11U), -53) - 1);
}

}  // namespace tiltproof::plant
