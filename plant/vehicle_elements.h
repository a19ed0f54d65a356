// The rotors and servos of a vehicle: from tiltproof's elements, else from the motor plugins of its SDF file.
// Internal to LoadVehicle.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "plant/sdf_files.h"
#include "plant/vehicle_model.h"

namespace tiltproof::plant {

struct RotorElement {
  std::filesystem::path file;
  int line = 0;
  std::string name{};  // empty: none is stated
  std::string link{};
  std::string joint{};  // that spins the propeller, if a plugin names it
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();
  double direction = 1, drag_ratio_m = 0;
  double force_min_n = 0, force_max_n = 0;
  double time_constant_up_s = 0, time_constant_down_s = 0;
  bool states_drag = true;             // false: a tiltproof element without drag_ratio_m
  std::vector<std::string> missing{};  // attributes that the plugin does not state
};

struct ServoElement {
  std::filesystem::path file;
  int line = 0;
  std::string joint{};
  ServoMode mode = ServoMode::kTorque;
  std::optional<double> torque_max_nm{}, speed_max_rad_s{};
  double time_constant_s = 0;
};

struct SensorElement {
  int line = 0;
  std::string name;
  double latency_s = 0;
};

struct VehicleElements {
  std::filesystem::path file;  // the one that has tiltproof's elements; empty: none has
  int line = 0;
  std::string base_link;
  std::vector<RotorElement> rotors;  // right before left
  bool from_plugins = false;         // the rotors; their servos are those of the joints' limits
  std::vector<ServoElement> servos;
  double sensor_rate_hz = 0;
  std::vector<SensorElement> sensors;
  Surroundings surroundings;
  BodyDrag drag;
};

// Letters, digits and '_', beginning with a letter: a name that signals can have.
bool IsPartName(std::string_view name);
// The nearest such name: "crazyflie/m1" is "crazyflie_m1".
std::string PartName(std::string_view name);

// The tiltproof elements from the mapping file if there is one, else from the model. Where they name no rotor,
// the motor plugins do. Adds errors to `problems`; what cannot be read has its default. Throws VehicleError
// when the mapping file cannot be read.
VehicleElements ReadElements(const SdfFiles& files, const std::filesystem::path& mapping,
                             std::vector<std::string>& warnings, std::vector<VehicleProblem>& problems);

// `<stem>.tiltproof.xml` beside the file.
std::filesystem::path MappingBeside(const std::filesystem::path& file);

}  // namespace tiltproof::plant
