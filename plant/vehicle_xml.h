// The text of a vehicle file: what libsdformat does not keep. That is line numbers, the tiltproof elements,
// and what has no effect here. Internal to LoadVehicle.
#pragma once

#include <tinyxml2.h>

#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "plant/vehicle_model.h"

namespace tiltproof::plant {

struct ThrusterElement {
  int line = 0;
  std::string name;  // empty: none given
  std::string link;
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();
  double direction = 1, drag_ratio_m = 0;
  double force_min_n = 0, force_max_n = 0;
};

struct ServoElement {
  int line = 0;
  std::string joint;
  std::optional<double> torque_max_nm;
};

struct SensorElement {
  int line = 0;
  std::string name;
  double latency_s = 0;
};

struct VehicleElements {
  std::filesystem::path file;  // the one that contains them
  int line = 0;
  std::string base_link;
  std::vector<ThrusterElement> thrusters;  // in the order of the rotors: right before left
  std::vector<ServoElement> servos;
  double sensor_rate_hz = 0;
  std::vector<SensorElement> sensors;
  Surroundings surroundings;
  BodyDrag drag;
};

// Letters, digits and '_', beginning with a letter: a name that signals can have.
bool IsPartName(std::string_view name);

// All errors are added to `problems`; what cannot be read has its default.
class VehicleXml {
 public:
  // Throws VehicleError when the file cannot be read, is not XML, or holds no single <model>.
  explicit VehicleXml(std::filesystem::path file);

  // The tiltproof elements from the mapping file if there is one, else from the model. Throws VehicleError
  // when the mapping file cannot be read.
  VehicleElements ReadElements(const std::filesystem::path& mapping, std::vector<std::string>& warnings,
                               std::vector<VehicleProblem>& problems) const;

  // Checks the version of SDF; the names: links and joints have one each, and joints join existing links; and that each
  // link states its mass and its moments of inertia, for which SDF has defaults that no vehicle has.
  void Check(std::vector<VehicleProblem>& problems) const;

  // One line for every element without effect on the flight.
  void WarnUnsupported(const VehicleElements& elements, std::vector<std::string>& warnings) const;

  const tinyxml2::XMLElement& model() const { return *model_; }

  // Line of <link name=...> or <joint name=...> (`tag`), or of a child of it; the line of the model when
  // there is no such element.
  int Line(std::string_view tag, std::string_view name, const char* child = nullptr) const;

 private:
  void CheckNames(std::vector<VehicleProblem>& problems) const;
  void CheckInertials(std::vector<VehicleProblem>& problems) const;
  void WarnLink(const tinyxml2::XMLElement& link, bool is_base, std::vector<std::string>& warnings) const;
  void WarnJoint(const tinyxml2::XMLElement& joint, std::vector<std::string>& warnings) const;
  void Warn(const tinyxml2::XMLElement& element, const std::string& text,
            std::vector<std::string>& warnings) const;

  std::filesystem::path file_;
  tinyxml2::XMLDocument document_;
  const tinyxml2::XMLElement* model_ = nullptr;
};

}  // namespace tiltproof::plant
