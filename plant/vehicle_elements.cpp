#include "plant/vehicle_elements.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <utility>

#include "link/disturbance.h"
#include "plant/motor_plugins.h"

namespace tiltproof::plant {
namespace {

using tinyxml2::XMLElement;

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
    std::string value = AttributeOf(element_, name);
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
    const std::optional<double> value = ParseNumber(text);
    if (value && std::isfinite(*value)) return value;
    Complain(fmt::format("'{}' must be a number, is '{}'", name, text));
    return std::nullopt;
  }

  const std::filesystem::path& file_;
  const XMLElement& element_;
  std::vector<VehicleProblem>& problems_;
};

RotorElement ReadRotor(const std::filesystem::path& file, const XMLElement& element,
                       std::vector<VehicleProblem>& problems) {
  const Attributes attributes(file, element,
                              {"name", "link", "axis", "direction", "drag_ratio_m", "force_min_n",
                               "force_max_n", "time_constant_s", "time_constant_down_s"},
                              problems);
  RotorElement rotor{.file = file, .line = element.GetLineNum()};
  rotor.name = AttributeOf(element, "name");
  rotor.link = attributes.Text("link");
  rotor.axis = attributes.UnitVector("axis").value_or(rotor.axis);
  rotor.direction = attributes.Number("direction", -1, 1).value_or(rotor.direction);
  if (std::abs(rotor.direction) != 1.0) attributes.Complain("'direction' must be 1 or -1");
  rotor.states_drag = element.Attribute("drag_ratio_m") != nullptr;
  rotor.drag_ratio_m = attributes.OptionalNumber("drag_ratio_m", 0, 10).value_or(0);
  rotor.force_min_n = attributes.OptionalNumber("force_min_n", -1e3, 1e3).value_or(0);
  const std::optional<double> force_max_n = attributes.Number("force_max_n", -1e3, 1e3);
  rotor.force_max_n = force_max_n.value_or(0);
  if (force_max_n && !(rotor.force_min_n < *force_max_n))
    attributes.Complain("'force_min_n' must be less than 'force_max_n'");
  rotor.time_constant_up_s = attributes.OptionalNumber("time_constant_s", 0, 10).value_or(0);
  rotor.time_constant_down_s =
      attributes.OptionalNumber("time_constant_down_s", 0, 10).value_or(rotor.time_constant_up_s);
  return rotor;
}

SensorElement ReadSensorElement(const std::filesystem::path& file, const XMLElement& element,
                                const std::string& scope, std::vector<VehicleProblem>& problems) {
  const Attributes attributes(file, element, {"name", "latency_s"}, problems);
  const std::string name = attributes.Text("name");
  return {.line = element.GetLineNum(),
          .name = name.empty() ? name : scope + name,
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

ServoElement ReadServo(const std::filesystem::path& file, const XMLElement& element,
                       std::vector<VehicleProblem>& problems) {
  const Attributes attributes(
      file, element, {"joint", "mode", "torque_max_nm", "speed_max_rad_s", "time_constant_s"}, problems);
  ServoElement servo{.file = file, .line = element.GetLineNum()};
  servo.joint = attributes.Text("joint");
  const std::string mode = AttributeOf(element, "mode");
  if (mode == "position") servo.mode = ServoMode::kPosition;
  if (mode != "position" && mode != "torque" && element.Attribute("mode") != nullptr)
    attributes.Complain(fmt::format("'mode' must be position or torque, is '{}'", mode));
  servo.torque_max_nm = attributes.OptionalNumber("torque_max_nm", 0, 1e3);
  servo.speed_max_rad_s = attributes.OptionalNumber("speed_max_rad_s", 1e-6, 1e3);
  servo.time_constant_s = attributes.OptionalNumber("time_constant_s", 0, 10).value_or(0);
  if (servo.mode == ServoMode::kTorque)
    for (const char* name : {"speed_max_rad_s", "time_constant_s"})
      if (element.Attribute(name) != nullptr)
        attributes.Complain(fmt::format("'{}' needs mode=\"position\"", name));
  return servo;
}

// Right before left. Two rotors without names are right and left, in order.
void OrderRotors(VehicleElements& elements, std::vector<VehicleProblem>& problems) {
  auto& rotors = elements.rotors;
  const auto complain = [&](const RotorElement& rotor, std::string message) {
    problems.push_back({rotor.file, rotor.line, std::move(message)});
  };
  if (rotors.empty() || rotors.size() > kRotorsMax) {
    problems.push_back({elements.file, elements.line,
                        fmt::format("a vehicle has 1 to {} <tiltproof:rotor>, or motor plugins; found {}",
                                    kRotorsMax, rotors.size())});
    return;
  }
  if (rotors.size() == 2) {
    if (rotors[0].name.empty() && rotors[1].name.empty()) {
      rotors[0].name = "right";
      rotors[1].name = "left";
    }
    const auto is_role = [](const std::string& name) { return name == "right" || name == "left"; };
    const bool first = is_role(rotors[0].name), second = is_role(rotors[1].name);
    if (first != second)
      complain(rotors[second ? 0 : 1],
               "one rotor must be named 'right', the other 'left' (or neither of them)");
    if (first && rotors[0].name == "left") std::swap(rotors[0], rotors[1]);
  }
  for (std::size_t i = 0; i < rotors.size(); ++i) {
    RotorElement& rotor = rotors[i];
    if (rotor.name.empty() && !rotor.link.empty()) rotor.name = PartName(rotor.link);
    if (!rotor.name.empty() && !IsPartName(rotor.name))
      complain(rotor, fmt::format("name: '{}' must be letters, digits and '_', and begin with a "
                                  "letter: signals are named after it",
                                  rotor.name));
    for (std::size_t j = 0; j < i; ++j) {
      if (rotor.link.empty()) continue;
      if (rotors[j].link == rotor.link)
        complain(rotor, "two rotors have link '" + rotor.link + "'");
      else if (rotors[j].name == rotor.name)
        complain(rotor, "two rotors have the name '" + rotor.name + "'");
    }
  }
}

// The names in it are those of the scope.
VehicleElements ReadVehicleElement(const std::filesystem::path& file, const XMLElement& vehicle,
                                   const std::string& scope, std::vector<VehicleProblem>& problems) {
  VehicleElements elements;
  elements.file = file;
  elements.line = vehicle.GetLineNum();
  bool has_base = false, has_sensors = false, has_drag = false, has_world = false;
  const auto scoped = [&](const std::string& name) { return name.empty() ? name : scope + name; };
  for (const auto* child = vehicle.FirstChildElement(); child != nullptr;
       child = child->NextSiblingElement()) {
    const std::string_view tag = child->Name();
    if (tag == "tiltproof:base") {
      const Attributes attributes(file, *child, {"link"}, problems);
      if (has_base) attributes.Complain("a vehicle has one <tiltproof:base>");
      has_base = true;
      elements.base_link = scoped(attributes.Text("link"));
    } else if (tag == "tiltproof:rotor" || tag == "tiltproof:thruster") {
      elements.rotors.push_back(ReadRotor(file, *child, problems));
      elements.rotors.back().link = scoped(elements.rotors.back().link);
    } else if (tag == "tiltproof:servo") {
      elements.servos.push_back(ReadServo(file, *child, problems));
      elements.servos.back().joint = scoped(elements.servos.back().joint);
    } else if (tag == "tiltproof:sensors") {
      const Attributes attributes(file, *child, {"rate_hz"}, problems);
      if (has_sensors) attributes.Complain("a vehicle has one <tiltproof:sensors>");
      has_sensors = true;
      elements.sensor_rate_hz = attributes.OptionalNumber("rate_hz", 1, 1e6).value_or(0);
    } else if (tag == "tiltproof:sensor") {
      elements.sensors.push_back(ReadSensorElement(file, *child, scope, problems));
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
           fmt::format("unknown element <{}>; known are tiltproof:base, tiltproof:rotor, tiltproof:servo, "
                       "tiltproof:sensors, tiltproof:sensor, tiltproof:world, tiltproof:drag",
                       tag)});
    }
  }
  if (!has_base) problems.push_back({file, elements.line, "<tiltproof:base link=\"...\"/> is missing"});
  return elements;
}

// The tiltproof element of the vehicle, else that of a model in it.
std::optional<VehicleElements> ReadEmbedded(const SdfFiles& files, std::vector<VehicleProblem>& problems) {
  for (const SdfModel& model : files.models())
    if (const XMLElement* element = model.element->FirstChildElement("tiltproof:vehicle"))
      return ReadVehicleElement(model.file, *element, model.scope, problems);
  return std::nullopt;
}

VehicleElements ReadMapping(const std::filesystem::path& file, std::vector<VehicleProblem>& problems) {
  tinyxml2::XMLDocument document;
  std::error_code error;
  if (!std::filesystem::exists(file, error)) throw VehicleError(file, 0, "no such file");
  if (!std::filesystem::is_regular_file(file, error)) throw VehicleError(file, 0, "not a file");
  if (document.LoadFile(file.c_str()) != tinyxml2::XML_SUCCESS)
    throw VehicleError(
        file, document.ErrorLineNum(),
        fmt::format("not well-formed XML ({})", tinyxml2::XMLDocument::ErrorIDToName(document.ErrorID())));
  const XMLElement* root = document.RootElement();
  if (root == nullptr || std::string_view(root->Name()) != "tiltproof:vehicle")
    throw VehicleError(file, root == nullptr ? 0 : root->GetLineNum(), "the root is not <tiltproof:vehicle>");
  return ReadVehicleElement(file, *root, "", problems);
}

std::string Joined(const std::vector<std::string>& words) {
  std::string text;
  for (std::size_t i = 0; i < words.size(); ++i)
    text += (i == 0 ? "" : i + 1 == words.size() ? " and " : ", ") + words[i];
  return text;
}

// The rotors of plugins, where the elements name none.
void AddPluginRotors(const SdfFiles& files, VehicleElements& elements,
                     std::vector<VehicleProblem>& problems) {
  if (!elements.rotors.empty()) return;
  elements.rotors = RotorsOfPlugins(files, problems);
  elements.from_plugins = !elements.rotors.empty();
  for (const RotorElement& rotor : elements.rotors) {
    if (rotor.missing.empty()) continue;
    problems.push_back(
        {rotor.file, rotor.line,
         fmt::format("rotor '{}': the plugin does not state {}", rotor.name, Joined(rotor.missing))});
  }
  if (elements.from_plugins && elements.file.empty())
    elements.base_link = files.CanonicalLink(files.models().front());
}

}  // namespace

bool IsPartName(std::string_view name) {
  const auto is_letter = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); };
  return !name.empty() && is_letter(name.front()) && std::all_of(name.begin(), name.end(), [&](char c) {
    return is_letter(c) || (c >= '0' && c <= '9') || c == '_';
  });
}

std::string PartName(std::string_view name) {
  if (IsPartName(name)) return std::string(name);
  std::string part;
  for (const char c : name) {
    if (IsPartName(std::string("a") + c))
      part += c;
    else if (!part.empty() && part.back() != '_')
      part += '_';
  }
  while (!part.empty() && part.back() == '_') part.pop_back();
  return IsPartName(part) ? part : "rotor_" + part;
}

std::filesystem::path MappingBeside(const std::filesystem::path& file) {
  std::filesystem::path beside = file;
  beside.replace_extension(".tiltproof.xml");
  return beside;
}

VehicleElements ReadElements(const SdfFiles& files, const std::filesystem::path& mapping,
                             std::vector<std::string>& warnings, std::vector<VehicleProblem>& problems) {
  std::error_code error;
  const std::filesystem::path beside = MappingBeside(files.file());
  const std::filesystem::path chosen =
      !mapping.empty() ? mapping
                       : (std::filesystem::exists(beside, error) ? beside : std::filesystem::path());
  const XMLElement& model = *files.models().front().element;
  VehicleElements elements;
  if (!chosen.empty()) {
    if (const XMLElement* embedded = model.FirstChildElement("tiltproof:vehicle"))
      warnings.push_back(fmt::format("{}:{}: <tiltproof:vehicle>: overridden by {}", files.file().string(),
                                     embedded->GetLineNum(), chosen.string()));
    elements = ReadMapping(chosen, problems);
  } else if (auto embedded = ReadEmbedded(files, problems)) {
    elements = *std::move(embedded);
  }
  AddPluginRotors(files, elements, problems);
  if (!elements.file.empty() || !elements.rotors.empty()) {
    OrderRotors(elements, problems);
    return elements;
  }
  problems.push_back(
      {files.file(), model.GetLineNum(),
       fmt::format("nothing names the links and joints that are the base, the rotors and the servos: there "
                   "is no motor plugin that tiltproof reads, <tiltproof:vehicle> is missing, and so is {}",
                   beside.filename().string())});
  return elements;
}

}  // namespace tiltproof::plant
