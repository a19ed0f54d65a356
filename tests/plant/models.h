// Where the tests' vehicles are.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
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

}  // namespace tiltproof::plant
