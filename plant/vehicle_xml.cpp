#include "plant/vehicle_xml.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <initializer_list>
#include <set>
#include <utility>

#include "link/disturbance.h"
#include "plant/sensor_elements.h"
#include "plant/vehicle_model.h"

namespace tiltproof::plant {
namespace {

using tinyxml2::XMLElement;

// A vehicle description is some kilobytes; anything huge is a mistake.
constexpr std::uintmax_t kFileBytesMax = 16U << 20U;

std::string Attribute(const XMLElement& element, const char* name) {
  const char* value = element.Attribute(name);
  return value == nullptr ? std::string() : std::string(value);
}

// `<plugin name="x">` as a person would write it.
std::string Describe(const XMLElement& element) {
  const std::string name = Attribute(element, "name");
  return name.empty() ? fmt::format("<{}>", element.Name())
                      : fmt::format("<{} name=\"{}\">", element.Name(), name);
}

bool IsOneOf(const XMLElement& element, std::initializer_list<std::string_view> names) {
  return std::find(names.begin(), names.end(), std::string_view(element.Name())) != names.end();
}

void Load(const std::filesystem::path& file, tinyxml2::XMLDocument& document) {
  std::error_code error;
  if (!std::filesystem::exists(file, error)) throw VehicleError(file, 0, "no such file");
  if (!std::filesystem::is_regular_file(file, error)) throw VehicleError(file, 0, "not a file");
  if (std::filesystem::file_size(file, error) > kFileBytesMax)
    throw VehicleError(file, 0, "larger than 16 MiB");
  if (document.LoadFile(file.c_str()) != tinyxml2::XML_SUCCESS) {
    throw VehicleError(
        file, document.ErrorLineNum(),
        fmt::format("not well-formed XML ({})", tinyxml2::XMLDocument::ErrorIDToName(document.ErrorID())));
  }
}

// Reads the attributes of one tiltproof element, and nothing but the ones asked for. One that cannot be read
// is a problem and nullopt.
class Attributes {
 public:
  Attributes(const std::filesystem::path& file, const XMLElement& element,
             std::initializer_list<std::string_view> known, std::vector<VehicleProblem>& problems)
      : file_(file), element_(element), problems_(problems) {
    for (const auto* attribute = element.FirstAttribute(); attribute != nullptr;
         attribute = attribute->Next()) {
      if (std::find(known.begin(), known.end(), std::string_view(attribute->Name())) == known.end()) {
        Complain(fmt::format("<{}> has no attribute '{}'", element.Name(), attribute->Name()));
      }
    }
    if (element.FirstChildElement() != nullptr) Complain(fmt::format("<{}> has no children", element.Name()));
  }

  std::string Text(const char* name) const {
    std::string value = Attribute(element_, name);
    if (value.empty()) Complain(fmt::format("<{}> needs the attribute '{}'", element_.Name(), name));
    return value;
  }
  std::optional<double> OptionalNumber(const char* name, double min, double max) const {
    if (element_.Attribute(name) == nullptr) return std::nullopt;
    return Number(name, min, max);
  }
  std::optional<double> Number(const char* name, double min, double max) const {
    const std::string text = Text(name);
    if (text.empty()) return std::nullopt;
    const std::optional<double> value = Parse(name, text);
    if (!value || (*value >= min && *value <= max)) return value;
    Complain(fmt::format("'{}' must be in [{}, {}], is {}", name, min, max, *value));
    return std::nullopt;
  }
  std::optional<Eigen::Vector3d> UnitVector(const char* name) const {
    const std::optional<Eigen::Vector3d> vector = OptionalVector(name);
    if (!vector || vector->norm() > 1e-9) return vector ? std::optional(vector->normalized()) : std::nullopt;
    Complain(fmt::format("'{}' must be three numbers, not all zero, is '{}'", name, Text(name)));
    return std::nullopt;
  }
  std::optional<Eigen::Vector3d> OptionalVector(const char* name) const {
    if (element_.Attribute(name) == nullptr) return std::nullopt;
    const std::string text = Text(name);
    Eigen::Vector3d vector = Eigen::Vector3d::Zero();
    std::size_t at = text.find_first_not_of(' ');
    Eigen::Index count = 0;
    for (; at != std::string::npos && count < 3; ++count) {
      const std::size_t end = std::min(text.find(' ', at), text.size());
      const std::optional<double> value = Parse(name, text.substr(at, end - at));
      if (!value) return std::nullopt;
      vector[count] = *value;
      at = text.find_first_not_of(' ', end);
    }
    if (count == 3 && at == std::string::npos) return vector;
    Complain(fmt::format("'{}' must be three numbers, is '{}'", name, text));
    return std::nullopt;
  }
  void Complain(const std::string& message) const {
    problems_.push_back({file_, element_.GetLineNum(), message});
  }

 private:
  std::optional<double> Parse(const char* name, const std::string& text) const {
    double value = 0;
    const char* end = text.data() + text.size();
    const auto [rest, error] = std::from_chars(text.data(), end, value);
    if (error == std::errc() && rest == end && std::isfinite(value)) return value;
    Complain(fmt::format("'{}' must be a number, is '{}'", name, text));
    return std::nullopt;
  }

  const std::filesystem::path& file_;
  const XMLElement& element_;
  std::vector<VehicleProblem>& problems_;
};

ThrusterElement ReadThruster(const std::filesystem::path& file, const XMLElement& element,
                             std::vector<VehicleProblem>& problems) {
  const Attributes attributes(
      file, element, {"name", "link", "axis", "direction", "drag_ratio_m", "force_min_n", "force_max_n"},
      problems);
  ThrusterElement thruster;
  thruster.line = element.GetLineNum();
  thruster.name = Attribute(element, "name");
  thruster.link = attributes.Text("link");
  thruster.axis = attributes.UnitVector("axis").value_or(thruster.axis);
  thruster.direction = attributes.Number("direction", -1, 1).value_or(thruster.direction);
  if (std::abs(thruster.direction) != 1.0) attributes.Complain("'direction' must be 1 or -1");
  thruster.drag_ratio_m = attributes.Number("drag_ratio_m", 0, 10).value_or(0);
  thruster.force_min_n = attributes.OptionalNumber("force_min_n", -1e3, 1e3).value_or(0);
  const std::optional<double> force_max_n = attributes.Number("force_max_n", -1e3, 1e3);
  thruster.force_max_n = force_max_n.value_or(0);
  if (force_max_n && !(thruster.force_min_n < *force_max_n))
    attributes.Complain("'force_min_n' must be less than 'force_max_n'");
  return thruster;
}

SensorElement ReadSensorElement(const std::filesystem::path& file, const XMLElement& element,
                                std::vector<VehicleProblem>& problems) {
  const Attributes attributes(file, element, {"name", "latency_s"}, problems);
  return {.line = element.GetLineNum(),
          .name = attributes.Text("name"),
          .latency_s = attributes.OptionalNumber("latency_s", 0, 10).value_or(0)};
}

Surroundings ReadSurroundings(const std::filesystem::path& file, const XMLElement& element,
                              std::vector<VehicleProblem>& problems) {
  const Attributes attributes(file, element,
                              {"magnetic_field_t", "latitude_deg", "longitude_deg", "elevation_m"}, problems);
  Surroundings read;
  read.magnetic_field_t = attributes.OptionalVector("magnetic_field_t").value_or(read.magnetic_field_t);
  // A larger one is in gauss or microtesla.
  if (read.magnetic_field_t.cwiseAbs().maxCoeff() > 1e-3)
    attributes.Complain("'magnetic_field_t' is in tesla: the Earth's is less than 1e-4");
  read.latitude_deg = attributes.OptionalNumber("latitude_deg", -90, 90).value_or(read.latitude_deg);
  read.longitude_deg = attributes.OptionalNumber("longitude_deg", -180, 180).value_or(read.longitude_deg);
  read.elevation_m = attributes.OptionalNumber("elevation_m", -500, 9000).value_or(read.elevation_m);
  return read;
}

// Right before left. Two thrusters without names are right and left, in order.
void OrderThrusters(VehicleElements& elements, std::vector<VehicleProblem>& problems) {
  auto& thrusters = elements.thrusters;
  const auto complain = [&](int line, std::string message) {
    problems.push_back({elements.file, line, std::move(message)});
  };
  if (thrusters.empty() || thrusters.size() > kRotorsMax) {
    complain(elements.line, fmt::format("a vehicle has 1 to {} <tiltproof:thruster>; found {}", kRotorsMax,
                                        thrusters.size()));
    return;
  }
  if (thrusters.size() == 2) {
    if (thrusters[0].name.empty() && thrusters[1].name.empty()) {
      thrusters[0].name = "right";
      thrusters[1].name = "left";
    }
    const auto is_role = [](const std::string& name) { return name == "right" || name == "left"; };
    const bool first = is_role(thrusters[0].name), second = is_role(thrusters[1].name);
    if (first != second)
      complain(thrusters[second ? 0 : 1].line,
               "one thruster must be named 'right', the other 'left' (or neither of them)");
    if (first && thrusters[0].name == "left") std::swap(thrusters[0], thrusters[1]);
  }
  for (std::size_t i = 0; i < thrusters.size(); ++i) {
    ThrusterElement& thruster = thrusters[i];
    if (thruster.name.empty()) thruster.name = thruster.link;
    if (!thruster.name.empty() && !IsPartName(thruster.name))
      complain(thruster.line, fmt::format("name: '{}' must be letters, digits and '_', and begin with a "
                                          "letter: signals are named after it",
                                          thruster.name));
    for (std::size_t j = 0; j < i; ++j) {
      if (thruster.link.empty()) continue;
      if (thrusters[j].link == thruster.link)
        complain(thruster.line, "two thrusters have link '" + thruster.link + "'");
      else if (thrusters[j].name == thruster.name)
        complain(thruster.line, "two thrusters have the name '" + thruster.name + "'");
    }
  }
}

VehicleElements ReadVehicleElement(const std::filesystem::path& file, const XMLElement& vehicle,
                                   std::vector<VehicleProblem>& problems) {
  VehicleElements elements;
  elements.file = file;
  elements.line = vehicle.GetLineNum();
  bool has_base = false, has_sensors = false, has_drag = false, has_world = false;
  for (const auto* child = vehicle.FirstChildElement(); child != nullptr;
       child = child->NextSiblingElement()) {
    const std::string_view tag = child->Name();
    if (tag == "tiltproof:base") {
      const Attributes attributes(file, *child, {"link"}, problems);
      if (has_base) attributes.Complain("a vehicle has one <tiltproof:base>");
      has_base = true;
      elements.base_link = attributes.Text("link");
    } else if (tag == "tiltproof:thruster") {
      elements.thrusters.push_back(ReadThruster(file, *child, problems));
    } else if (tag == "tiltproof:servo") {
      const Attributes attributes(file, *child, {"joint", "torque_max_nm"}, problems);
      elements.servos.push_back({.line = child->GetLineNum(),
                                 .joint = attributes.Text("joint"),
                                 .torque_max_nm = attributes.OptionalNumber("torque_max_nm", 0, 1e3)});
    } else if (tag == "tiltproof:sensors") {
      const Attributes attributes(file, *child, {"rate_hz"}, problems);
      if (has_sensors) attributes.Complain("a vehicle has one <tiltproof:sensors>");
      has_sensors = true;
      elements.sensor_rate_hz = attributes.OptionalNumber("rate_hz", 1, 1e6).value_or(0);
    } else if (tag == "tiltproof:sensor") {
      elements.sensors.push_back(ReadSensorElement(file, *child, problems));
    } else if (tag == "tiltproof:world") {
      if (std::exchange(has_world, true))
        problems.push_back({file, child->GetLineNum(), "a vehicle has one <tiltproof:world>"});
      elements.surroundings = ReadSurroundings(file, *child, problems);
    } else if (tag == "tiltproof:drag") {
      const Attributes attributes(file, *child, {"linear_n_s_m", "quadratic_n_s2_m2"}, problems);
      if (has_drag) attributes.Complain("a vehicle has one <tiltproof:drag>");
      has_drag = true;
      elements.drag = {attributes.OptionalNumber("linear_n_s_m", 0, 100).value_or(0),
                       attributes.OptionalNumber("quadratic_n_s2_m2", 0, 100).value_or(0)};
    } else {
      problems.push_back(
          {file, child->GetLineNum(),
           fmt::format("unknown element <{}>; known are tiltproof:base, tiltproof:thruster, tiltproof:servo, "
                       "tiltproof:sensors, tiltproof:sensor, tiltproof:world, tiltproof:drag",
                       tag)});
    }
  }
  if (!has_base) problems.push_back({file, elements.line, "<tiltproof:base link=\"...\"/> is missing"});
  OrderThrusters(elements, problems);
  return elements;
}

// "1.9"
bool IsVersion(std::string_view text) {
  const std::size_t point = text.find('.');
  if (point == std::string_view::npos) return false;
  const auto is_number = [](std::string_view part) {
    return !part.empty() && part.size() < 4 &&
           std::all_of(part.begin(), part.end(), [](char c) { return c >= '0' && c <= '9'; });
  };
  return is_number(text.substr(0, point)) && is_number(text.substr(point + 1));
}

}  // namespace

bool IsPartName(std::string_view name) {
  const auto is_letter = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); };
  return !name.empty() && is_letter(name.front()) && std::all_of(name.begin(), name.end(), [&](char c) {
    return is_letter(c) || (c >= '0' && c <= '9') || c == '_';
  });
}

VehicleXml::VehicleXml(std::filesystem::path file) : file_(std::move(file)) {
  Load(file_, document_);
  const XMLElement* root = document_.RootElement();
  if (root == nullptr || std::string_view(root->Name()) != "sdf") {
    throw VehicleError(file_, root == nullptr ? 0 : root->GetLineNum(),
                       "not an SDF file: the root is not <sdf>");
  }
  model_ = root->FirstChildElement("model");
  if (model_ == nullptr) throw VehicleError(file_, root->GetLineNum(), "holds no <model>");
  if (const auto* second = model_->NextSiblingElement("model")) {
    throw VehicleError(file_, second->GetLineNum(), "holds a second <model>");
  }
}

VehicleElements VehicleXml::ReadElements(const std::filesystem::path& mapping,
                                         std::vector<std::string>& warnings,
                                         std::vector<VehicleProblem>& problems) const {
  const XMLElement* embedded = model_->FirstChildElement("tiltproof:vehicle");
  std::filesystem::path beside = file_;
  beside.replace_extension(".tiltproof.xml");
  std::error_code error;
  const std::filesystem::path chosen =
      !mapping.empty() ? mapping
                       : (std::filesystem::exists(beside, error) ? beside : std::filesystem::path());
  if (chosen.empty()) {
    if (embedded != nullptr) return ReadVehicleElement(file_, *embedded, problems);
    problems.push_back(
        {file_, model_->GetLineNum(),
         fmt::format("nothing names the links and joints that are the base, the thrusters and the servos: "
                     "<tiltproof:vehicle> is missing, and so is {}",
                     beside.filename().string())});
    return {};
  }
  if (embedded != nullptr) Warn(*embedded, "overridden by " + chosen.string(), warnings);
  tinyxml2::XMLDocument document;
  Load(chosen, document);
  const XMLElement* root = document.RootElement();
  if (root == nullptr || std::string_view(root->Name()) != "tiltproof:vehicle") {
    throw VehicleError(chosen, root == nullptr ? 0 : root->GetLineNum(),
                       "the root is not <tiltproof:vehicle>");
  }
  return ReadVehicleElement(chosen, *root, problems);
}

void VehicleXml::Check(std::vector<VehicleProblem>& problems) const {
  CheckNames(problems);
  CheckInertials(problems);
}

void VehicleXml::CheckNames(std::vector<VehicleProblem>& problems) const {
  const auto complain = [&](const XMLElement& element, std::string message) {
    problems.push_back({file_, element.GetLineNum(), std::move(message)});
  };
  const XMLElement& root = *document_.RootElement();
  if (const std::string version = Attribute(root, "version"); !IsVersion(version))
    complain(root, fmt::format("<sdf version=\"{}\">: a version is two numbers, such as 1.9", version));

  std::set<std::string> links, joints;
  const auto unique = [&](const XMLElement& element, std::set<std::string>& names) {
    const std::string name = Attribute(element, "name");
    if (name.empty()) {
      complain(element, fmt::format("<{}> has no name", element.Name()));
    } else if (!names.insert(name).second) {
      complain(element, fmt::format("a second {} '{}'", element.Name(), name));
    }
  };
  for (const auto* e = model_->FirstChildElement("link"); e != nullptr; e = e->NextSiblingElement("link")) {
    unique(*e, links);
  }
  for (const auto* e = model_->FirstChildElement("joint"); e != nullptr; e = e->NextSiblingElement("joint")) {
    unique(*e, joints);
    for (const char* end : {"parent", "child"}) {
      const XMLElement* reference = e->FirstChildElement(end);
      const char* text = reference == nullptr ? nullptr : reference->GetText();
      const std::string joint = Attribute(*e, "name");
      if (text == nullptr) {
        complain(*e, fmt::format("joint '{}' has no <{}>", joint, end));
      } else if (!links.contains(text)) {
        complain(*reference, fmt::format("joint '{}': {} link '{}' does not exist", joint, end, text));
      }
    }
  }
}

void VehicleXml::CheckInertials(std::vector<VehicleProblem>& problems) const {
  for (const auto* link = model_->FirstChildElement("link"); link != nullptr;
       link = link->NextSiblingElement("link")) {
    const std::string name = Attribute(*link, "name");
    const auto complain = [&](const XMLElement& element, std::string_view missing, std::string_view unit) {
      problems.push_back({file_, element.GetLineNum(),
                          fmt::format("link '{}' has no <{}>: SDF puts 1 {} in its place, so state it", name,
                                      missing, unit)});
    };
    const XMLElement* inertial = link->FirstChildElement("inertial");
    if (inertial == nullptr) {
      complain(*link, "inertial", "kg and 1 kg m^2");
      continue;
    }
    if (inertial->FirstChildElement("mass") == nullptr) complain(*inertial, "mass", "kg");
    const XMLElement* inertia = inertial->FirstChildElement("inertia");
    if (inertia == nullptr) {
      complain(*inertial, "inertia", "kg m^2");
      continue;
    }
    for (const char* moment : {"ixx", "iyy", "izz"})
      if (inertia->FirstChildElement(moment) == nullptr) complain(*inertia, moment, "kg m^2");
  }
}

void VehicleXml::Warn(const XMLElement& element, const std::string& text,
                      std::vector<std::string>& warnings) const {
  warnings.push_back(
      fmt::format("{}:{}: {}: {}", file_.string(), element.GetLineNum(), Describe(element), text));
}

void VehicleXml::WarnLink(const XMLElement& link, bool is_base, std::vector<std::string>& warnings) const {
  const std::string where = fmt::format(" (link '{}')", Attribute(link, "name"));
  bool has_shape = false;
  for (const auto* child = link.FirstChildElement(); child != nullptr; child = child->NextSiblingElement()) {
    if (IsOneOf(*child, {"inertial", "pose"})) continue;
    if (IsOneOf(*child, {"collision", "visual"})) {
      const bool is_collision = IsOneOf(*child, {"collision"});
      const XMLElement* geometry = child->FirstChildElement("geometry");
      const XMLElement* shape = geometry == nullptr ? nullptr : geometry->FirstChildElement();
      if (shape != nullptr && IsOneOf(*shape, {"mesh"})) {
        const XMLElement* uri = shape->FirstChildElement("uri");
        const char* text = uri == nullptr ? nullptr : uri->GetText();
        Warn(*shape,
             fmt::format("meshes are not supported, ignored: {} in {}{}", text == nullptr ? "(no uri)" : text,
                         Describe(*child), where),
             warnings);
      } else if (is_collision && !is_base) {
        Warn(*child, "ignored: only the base touches the ground" + where, warnings);
      } else if (is_collision && (shape == nullptr || !IsOneOf(*shape, {"box", "sphere", "cylinder"}))) {
        Warn(*child, "ignored: the shapes supported are box, sphere and cylinder" + where, warnings);
      } else if (is_collision && has_shape) {
        Warn(*child, "ignored: the first collision shape counts" + where, warnings);
      } else if (is_collision) {
        has_shape = true;
      }
      continue;  // a primitive visual is for viewers
    }
    if (IsOneOf(*child, {"sensor"})) {
      if (const std::string type = Attribute(*child, "type"); !IsSensorType(type))
        Warn(*child, fmt::format("sensors of type '{}' are not supported, ignored{}", type, where), warnings);
      for (const auto* plugin = child->FirstChildElement("plugin"); plugin != nullptr;
           plugin = plugin->NextSiblingElement("plugin")) {
        Warn(*plugin, "plugins are not supported, ignored" + where, warnings);
      }
      continue;
    }
    Warn(*child, "not supported, ignored" + where, warnings);
  }
  if (is_base && !has_shape) {
    Warn(link,
         "has no usable collision shape: the box of uniform density with its mass and inertia touches the "
         "ground",
         warnings);
  }
}

void VehicleXml::WarnJoint(const XMLElement& joint, std::vector<std::string>& warnings) const {
  const std::string where = fmt::format(" (joint '{}')", Attribute(joint, "name"));
  for (const auto* child = joint.FirstChildElement(); child != nullptr; child = child->NextSiblingElement()) {
    if (IsOneOf(*child, {"parent", "child", "pose"})) continue;
    if (!IsOneOf(*child, {"axis"})) {
      Warn(*child, "not supported, ignored" + where, warnings);
      continue;
    }
    for (const auto* part = child->FirstChildElement(); part != nullptr; part = part->NextSiblingElement()) {
      if (IsOneOf(*part, {"xyz", "use_parent_model_frame"})) continue;
      if (!IsOneOf(*part, {"limit", "dynamics"})) {
        Warn(*part, "not supported, ignored" + where, warnings);
        continue;
      }
      for (const auto* value = part->FirstChildElement(); value != nullptr;
           value = value->NextSiblingElement()) {
        if (IsOneOf(*value, {"lower", "upper", "effort"})) continue;
        if (IsOneOf(*value, {"velocity"})) {
          Warn(*value,
               fmt::format("the speed limit {} is not enforced{}", value->GetText() ? value->GetText() : "",
                           where),
               warnings);
        } else if (value->DoubleText(1) != 0) {
          Warn(*value, "not supported, ignored" + where, warnings);
        }
      }
    }
  }
}

void VehicleXml::WarnUnsupported(const VehicleElements& elements, std::vector<std::string>& warnings) const {
  for (const auto* e = document_.RootElement()->FirstChildElement(); e != nullptr;
       e = e->NextSiblingElement()) {
    if (e != model_) Warn(*e, "not supported, ignored", warnings);
  }
  for (const auto* e = model_->FirstChildElement(); e != nullptr; e = e->NextSiblingElement()) {
    if (IsOneOf(*e, {"link"})) {
      WarnLink(*e, Attribute(*e, "name") == elements.base_link, warnings);
    } else if (IsOneOf(*e, {"joint"})) {
      WarnJoint(*e, warnings);
    } else if (IsOneOf(*e, {"plugin"})) {
      Warn(*e, "plugins are not supported, ignored", warnings);
    } else if (IsOneOf(*e, {"pose"})) {
      Warn(*e, "of the model is ignored: the scenario says where the vehicle starts", warnings);
    } else if (!IsOneOf(*e, {"frame", "tiltproof:vehicle"})) {
      Warn(*e, "not supported, ignored", warnings);
    }
  }
}

int VehicleXml::Line(std::string_view tag, std::string_view name, const char* child) const {
  for (const auto* e = model_->FirstChildElement(); e != nullptr; e = e->NextSiblingElement()) {
    if (tag != e->Name() || Attribute(*e, "name") != name) continue;
    if (child == nullptr) return e->GetLineNum();
    // A child, or a grandchild such as inertial/inertia.
    for (const auto* c = e->FirstChildElement(); c != nullptr; c = c->NextSiblingElement()) {
      if (std::string_view(c->Name()) == child) return c->GetLineNum();
      if (const auto* g = c->FirstChildElement(child)) return g->GetLineNum();
    }
    return e->GetLineNum();
  }
  return model_->GetLineNum();
}

}  // namespace tiltproof::plant
