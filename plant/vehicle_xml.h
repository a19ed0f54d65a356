// Checks of a vehicle's text that libsdformat does not make, and warnings of what has no effect here. Internal to
// LoadVehicle.
#pragma once

#include <filesystem>
#include <functional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "plant/sdf_files.h"
#include "plant/vehicle_elements.h"
#include "plant/vehicle_model.h"

namespace tiltproof::plant {

// All errors are added to `problems`.
class VehicleXml {
 public:
  // Throws VehicleError: see SdfFiles.
  explicit VehicleXml(const std::filesystem::path& file);

  const SdfFiles& files() const { return files_; }

  // Checks the version of SDF; the names: links and joints have one each, and joints join existing links; and
  // the texts of numbers.
  void Check(std::vector<VehicleProblem>& problems) const;

  // Checks that each link states its mass and its moments of inertia, for which SDF has defaults that no vehicle
  // has. Some links may lack <inertial> as a whole.
  void CheckInertials(const std::function<bool(const std::string& link)>& may_lack,
                      std::vector<VehicleProblem>& problems) const;

  // One line for every element without effect on the flight.
  void WarnUnsupported(const VehicleElements& elements, const std::set<std::string>& hinges,
                       std::vector<std::string>& warnings) const;

  // Place of <link name=...> or <joint name=...> (`tag`), or of a child of it; the model's when there is no such
  // element.
  SdfPlace Place(std::string_view tag, std::string_view name, const char* child = nullptr) const;

 private:
  void CheckNames(std::vector<VehicleProblem>& problems) const;
  void CheckNumbers(std::vector<VehicleProblem>& problems) const;
  void CheckNumbersIn(const tinyxml2::XMLElement& element, const std::filesystem::path& file,
                      std::vector<VehicleProblem>& problems) const;
  void WarnLink(const SdfPart& part, bool is_base, std::vector<std::string>& warnings) const;
  void WarnJoint(const SdfPart& part, bool has_speed_limit, std::vector<std::string>& warnings) const;
  void Warn(const std::filesystem::path& file, const tinyxml2::XMLElement& element, const std::string& text,
            std::vector<std::string>& warnings) const;

  SdfFiles files_;
};

}  // namespace tiltproof::plant
