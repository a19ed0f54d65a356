// The text of a vehicle: its SDF file and the files that it includes, as flat lists of links, joints, frames
// and plugins. Each part has its full name ("load::box"), its file and its line. Internal to LoadVehicle.
//
//   SdfFiles files("x500/model.sdf");
//   files.Link("base_link")->file();  // "x500_base/model.sdf"
//
// libsdformat 12 drops joints whose unused axis is 0 0 0 and refuses files of newer versions, so that this code
// resolves <include> itself. plant/sdf_file.h gives libsdformat what is left: poses, axes, inertias, shapes.
#pragma once

#include <tinyxml2.h>

#include <deque>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "plant/vehicle_model.h"

namespace tiltproof::plant {

// Text of an attribute; empty when there is none.
std::string AttributeOf(const tinyxml2::XMLElement& element, const char* name);
// Text of the element without blanks at its ends; empty for null.
std::string TrimmedText(const tinyxml2::XMLElement* element);

// The number that the text is, without blanks; nullopt when it is none. "inf" is one, "1,925" and "pi/2" are not.
std::optional<double> ParseNumber(std::string_view text);
// The parts of the text between blanks.
std::vector<std::string> Words(std::string_view text);

// A <model>: the vehicle itself, or one that it includes or nests.
struct SdfModel {
  std::filesystem::path file;
  const tinyxml2::XMLElement* element = nullptr;
  const tinyxml2::XMLElement* pose = nullptr;  // in `around`; null: none is stated
  const SdfModel* around = nullptr;            // null: this is the vehicle
  std::string scope{};  // before the names of its links: "load::"; merged: that of `around`
  std::string frame{};  // name of its frame; empty: the vehicle's
  int version = 109;    // 1.9
};

struct SdfPlace {
  std::filesystem::path file;
  int line = 0;  // from 1; 0: unknown
};

struct SdfPart {
  const tinyxml2::XMLElement* element = nullptr;
  const SdfModel* model = nullptr;
  std::string name;  // "load::box"

  int line() const { return element->GetLineNum(); }
  const std::filesystem::path& file() const { return model->file; }
};

class SdfFiles {
 public:
  // Throws VehicleError when a file cannot be read or found, is not SDF, or holds no single <model>.
  explicit SdfFiles(const std::filesystem::path& file);

  const std::filesystem::path& file() const { return models_.front().file; }
  const tinyxml2::XMLElement& root() const { return *documents_.front()->RootElement(); }
  // The first is the vehicle.
  const std::deque<SdfModel>& models() const { return models_; }
  const std::vector<SdfPart>& links() const { return links_; }
  const std::vector<SdfPart>& joints() const { return joints_; }
  const std::vector<SdfPart>& frames() const { return frames_; }
  const std::vector<SdfPart>& plugins() const { return plugins_; }
  // Null when there is none.
  const SdfPart* Link(std::string_view name) const;
  const SdfPart* Joint(std::string_view name) const;
  // The full name of the link that `name` means in the model: a link, a frame on one, or a model. It exists if
  // Link() finds it.
  std::string LinkNamed(const SdfModel& model, const std::string& name) const;
  // The model with this scope, such as "load::"; null when there is none.
  const SdfModel* ModelOf(std::string_view scope) const;
  // The first link of the model, or its canonical_link; empty when it has no link.
  std::string CanonicalLink(const SdfModel& model) const;
  // Files that the vehicle includes, in the order of their first use.
  std::vector<std::filesystem::path> included() const;

 private:
  const tinyxml2::XMLElement& Open(const std::filesystem::path& file);
  void Gather(const SdfModel& model);
  void Include(const SdfModel& around, const tinyxml2::XMLElement& include);
  void Nest(const SdfModel& around, const tinyxml2::XMLElement& element, SdfModel nested,
            const std::string& name, bool merged);

  std::vector<std::unique_ptr<tinyxml2::XMLDocument>> documents_;
  std::deque<SdfModel> models_;
  std::vector<SdfPart> links_, joints_, frames_, plugins_;
};

}  // namespace tiltproof::plant
