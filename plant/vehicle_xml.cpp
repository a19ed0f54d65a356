#include "plant/vehicle_xml.h"

#include <fmt/core.h>

#include <algorithm>
#include <initializer_list>

#include "plant/sensor_elements.h"
#include "plant/vehicle_model.h"

namespace tiltproof::plant {
namespace {

using tinyxml2::XMLElement;

// `<plugin name="x">` as a person would write it.
std::string Describe(const XMLElement& element) {
  const std::string name = AttributeOf(element, "name");
  return name.empty() ? fmt::format("<{}>", element.Name())
                      : fmt::format("<{} name=\"{}\">", element.Name(), name);
}

bool IsOneOf(const XMLElement& element, std::initializer_list<std::string_view> names) {
  return std::find(names.begin(), names.end(), std::string_view(element.Name())) != names.end();
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

// Elements that say what tiltproof does anyway.
bool HasNoEffect(const XMLElement& element) {
  const std::string text = TrimmedText(&element);
  const bool is_on = text == "1" || text == "true", is_off = text == "0" || text == "false";
  if (IsOneOf(element, {"gravity"})) return is_on;
  if (IsOneOf(element, {"self_collide", "kinematic", "enable_wind"})) return is_off;
  return IsOneOf(element, {"velocity_decay"}) && element.NoChildren();
}

bool IsZero(const XMLElement& pose) {
  const std::vector<std::string> words = Words(TrimmedText(&pose));
  return std::all_of(words.begin(), words.end(),
                     [](const std::string& word) { return ParseNumber(word) == 0.0; });
}

// Its numbers are those of a rotor or a servo.
bool IsRead(const SdfFiles& files, const SdfPart& plugin, const VehicleElements& elements) {
  const auto is_inside = [&](const auto& part) {
    return part.file == plugin.file() && part.line >= plugin.line();
  };
  const std::string filename =
      AttributeOf(*plugin.element, "filename") + AttributeOf(*plugin.element, "name");
  if (!elements.from_plugins) return false;
  if (filename.find("otorModel") != std::string::npos || filename.find("motor_model") != std::string::npos)
    return std::any_of(elements.rotors.begin(), elements.rotors.end(), is_inside);
  // The blades of ArduPilot's propellers; wings have the same plugin.
  if (filename.find("LiftDrag") != std::string::npos || filename.find("lift-drag") != std::string::npos) {
    const XMLElement* const name = plugin.element->FirstChildElement("link_name");
    const std::string link =
        name == nullptr || name->GetText() == nullptr ? "" : files.LinkNamed(*plugin.model, name->GetText());
    return std::any_of(elements.rotors.begin(), elements.rotors.end(),
                       [&](const RotorElement& rotor) { return rotor.link == link; });
  }
  return filename.find("ArduPilotPlugin") != std::string::npos;
}

}  // namespace

VehicleXml::VehicleXml(const std::filesystem::path& file) : files_(file) {}

void VehicleXml::Check(std::vector<VehicleProblem>& problems) const {
  const XMLElement& root = files_.root();
  if (const std::string version = AttributeOf(root, "version"); !IsVersion(version))
    problems.push_back({files_.file(), root.GetLineNum(),
                        fmt::format("<sdf version=\"{}\">: a version is two numbers, such as 1.9", version)});
  const XMLElement& model = *files_.models().front().element;
  if (const std::string is_static = TrimmedText(model.FirstChildElement("static"));
      is_static == "1" || is_static == "true")
    problems.push_back({files_.file(), model.GetLineNum(), "a <static> model cannot fly"});
  CheckNames(problems);
  CheckNumbers(problems);
}

void VehicleXml::CheckNames(std::vector<VehicleProblem>& problems) const {
  const auto complain = [&](const SdfPart& part, int line, std::string message) {
    problems.push_back({part.file(), line, std::move(message)});
  };
  const auto unique = [&](const SdfPart& part, std::set<std::string>& names) {
    if (part.element->Attribute("name") == nullptr || AttributeOf(*part.element, "name").empty()) {
      complain(part, part.line(), fmt::format("<{}> has no name", part.element->Name()));
    } else if (!names.insert(part.name).second) {
      complain(part, part.line(), fmt::format("a second {} '{}'", part.element->Name(), part.name));
    }
  };
  std::set<std::string> links, joints;
  for (const SdfPart& link : files_.links()) unique(link, links);
  for (const SdfPart& joint : files_.joints()) {
    unique(joint, joints);
    for (const char* end : {"parent", "child"}) {
      const XMLElement* reference = joint.element->FirstChildElement(end);
      const std::string text = TrimmedText(reference);
      if (text.empty()) {
        complain(joint, joint.line(), fmt::format("joint '{}' has no <{}>", joint.name, end));
      } else if (text == "world") {
        complain(joint, reference->GetLineNum(),
                 fmt::format("joint '{}' holds the vehicle on the world: remove it", joint.name));
      } else if (!links.contains(files_.LinkNamed(*joint.model, text))) {
        complain(joint, reference->GetLineNum(),
                 fmt::format("joint '{}': {} link '{}' does not exist", joint.name, end, text));
      }
    }
  }
}

// Numbers that are read: libsdformat 12 reads "1,925" as 1, and refuses "pi/2" without its place.
void VehicleXml::CheckNumbers(std::vector<VehicleProblem>& problems) const {
  for (const SdfModel& model : files_.models())
    if (model.pose != nullptr) CheckNumbersIn(*model.pose, model.around->file, problems);
  for (const SdfPart& frame : files_.frames())
    if (const auto* pose = frame.element->FirstChildElement("pose"))
      CheckNumbersIn(*pose, frame.file(), problems);
  for (const SdfPart& link : files_.links())
    for (const auto* e = link.element->FirstChildElement(); e != nullptr; e = e->NextSiblingElement())
      if (IsOneOf(*e, {"pose", "inertial", "collision"})) CheckNumbersIn(*e, link.file(), problems);
  for (const SdfPart& joint : files_.joints()) {
    if (const auto* pose = joint.element->FirstChildElement("pose"))
      CheckNumbersIn(*pose, joint.file(), problems);
    // The axis of a fixed joint has no meaning.
    const XMLElement* axis = joint.element->FirstChildElement("axis");
    if (axis == nullptr || joint.element->Attribute("type", "revolute") == nullptr) continue;
    for (const char* tag : {"xyz", "limit"})
      if (const auto* e = axis->FirstChildElement(tag)) CheckNumbersIn(*e, joint.file(), problems);
  }
}

void VehicleXml::CheckNumbersIn(const XMLElement& element, const std::filesystem::path& file,
                                std::vector<VehicleProblem>& problems) const {
  if (IsOneOf(element, {"surface", "mesh", "heightmap", "polyline", "fluid_added_mass"})) return;
  for (const auto* e = element.FirstChildElement(); e != nullptr; e = e->NextSiblingElement())
    CheckNumbersIn(*e, file, problems);
  std::size_t count = 1;
  if (IsOneOf(element, {"pose"}))
    count = element.Attribute("rotation_format", "quat_xyzw") != nullptr ? 7 : 6;
  else if (IsOneOf(element, {"xyz", "size"}))
    count = 3;
  else if (!IsOneOf(element, {"mass", "ixx", "ixy", "ixz", "iyy", "iyz", "izz", "lower", "upper", "effort",
                              "velocity", "radius", "length"}))
    return;
  const std::string text = TrimmedText(&element);
  const std::vector<std::string> words = Words(text);
  if (words.empty() && IsOneOf(element, {"pose"})) return;
  const auto complain = [&](const std::string& message) {
    problems.push_back({file, element.GetLineNum(), fmt::format("<{}>: {}", element.Name(), message)});
  };
  for (const std::string& word : words)
    if (!ParseNumber(word)) return complain(fmt::format("'{}' is not a number", word));
  if (words.size() != count)
    complain(fmt::format("needs {} number{}, is '{}'", count, count == 1 ? "" : "s", text));
}

void VehicleXml::CheckInertials(const std::function<bool(const std::string&)>& may_lack,
                                std::vector<VehicleProblem>& problems) const {
  for (const SdfPart& link : files_.links()) {
    const auto complain = [&](const XMLElement& element, std::string_view missing, std::string_view unit) {
      problems.push_back({link.file(), element.GetLineNum(),
                          fmt::format("link '{}' has no <{}>: SDF puts 1 {} in its place, so state it",
                                      link.name, missing, unit)});
    };
    const XMLElement* inertial = link.element->FirstChildElement("inertial");
    if (inertial == nullptr) {
      if (!may_lack(link.name)) complain(*link.element, "inertial", "kg and 1 kg m^2");
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

void VehicleXml::Warn(const std::filesystem::path& file, const XMLElement& element, const std::string& text,
                      std::vector<std::string>& warnings) const {
  warnings.push_back(
      fmt::format("{}:{}: {}: {}", file.string(), element.GetLineNum(), Describe(element), text));
}

bool VehicleXml::WarnLink(const SdfPart& part, std::vector<std::string>& warnings) const {
  const XMLElement& link = *part.element;
  const std::string where = fmt::format(" (link '{}')", part.name);
  bool has_shape = false;
  for (const auto* child = link.FirstChildElement(); child != nullptr; child = child->NextSiblingElement()) {
    // A visual is for viewers.
    if (IsOneOf(*child, {"inertial", "pose", "visual"}) || HasNoEffect(*child)) continue;
    if (IsOneOf(*child, {"collision"})) {
      const XMLElement* geometry = child->FirstChildElement("geometry");
      const XMLElement* shape = geometry == nullptr ? nullptr : geometry->FirstChildElement();
      if (shape != nullptr && IsOneOf(*shape, {"mesh"})) {
        const XMLElement* uri = shape->FirstChildElement("uri");
        const char* text = uri == nullptr ? nullptr : uri->GetText();
        Warn(part.file(), *shape,
             fmt::format("meshes are not supported, ignored: {} in {}{}", text == nullptr ? "(no uri)" : text,
                         Describe(*child), where),
             warnings);
      } else if ((shape == nullptr || !IsOneOf(*shape, {"box", "sphere", "cylinder"}))) {
        Warn(part.file(), *child, "ignored: the shapes supported are box, sphere and cylinder" + where,
             warnings);
      } else {
        has_shape = true;
      }
      continue;
    }
    if (IsOneOf(*child, {"sensor"})) {
      if (const std::string type = AttributeOf(*child, "type"); !IsSensorType(type))
        Warn(part.file(), *child,
             fmt::format("sensors of type '{}' are not supported, ignored{}", type, where), warnings);
      for (const auto* plugin = child->FirstChildElement("plugin"); plugin != nullptr;
           plugin = plugin->NextSiblingElement("plugin")) {
        Warn(part.file(), *plugin, "plugins are not supported, ignored" + where, warnings);
      }
      continue;
    }
    Warn(part.file(), *child, "not supported, ignored" + where, warnings);
  }
  return has_shape;
}

void VehicleXml::WarnJoint(const SdfPart& own, bool has_speed_limit,
                           std::vector<std::string>& warnings) const {
  const XMLElement& joint = *own.element;
  const std::string where = fmt::format(" (joint '{}')", own.name);
  for (const auto* child = joint.FirstChildElement(); child != nullptr; child = child->NextSiblingElement()) {
    if (IsOneOf(*child, {"parent", "child", "pose"})) continue;
    if (!IsOneOf(*child, {"axis"})) {
      Warn(own.file(), *child, "not supported, ignored" + where, warnings);
      continue;
    }
    for (const auto* part = child->FirstChildElement(); part != nullptr; part = part->NextSiblingElement()) {
      if (IsOneOf(*part, {"xyz", "use_parent_model_frame"})) continue;
      if (!IsOneOf(*part, {"limit", "dynamics"})) {
        Warn(own.file(), *part, "not supported, ignored" + where, warnings);
        continue;
      }
      for (const auto* value = part->FirstChildElement(); value != nullptr;
           value = value->NextSiblingElement()) {
        if (IsOneOf(*value, {"lower", "upper", "effort"})) continue;
        if (IsOneOf(*value, {"velocity"})) {
          if (has_speed_limit) continue;
          Warn(own.file(), *value,
               fmt::format("the speed limit {} is not enforced{}", value->GetText() ? value->GetText() : "",
                           where),
               warnings);
        } else if (value->DoubleText(1) != 0) {
          Warn(own.file(), *value, "not supported, ignored" + where, warnings);
        }
      }
    }
  }
}

void VehicleXml::WarnUnsupported(const VehicleElements& elements, const std::set<std::string>& hinges,
                                 std::vector<std::string>& warnings) const {
  for (const auto* e = files_.root().FirstChildElement(); e != nullptr; e = e->NextSiblingElement())
    if (e != files_.models().front().element) Warn(files_.file(), *e, "not supported, ignored", warnings);
  for (const SdfModel& model : files_.models())
    for (const auto* e = model.element->FirstChildElement(); e != nullptr; e = e->NextSiblingElement()) {
      if (IsOneOf(*e, {"link", "joint", "plugin", "frame", "include", "model", "static", "allow_auto_disable",
                       "tiltproof:vehicle"}) ||
          HasNoEffect(*e)) {
        continue;
      } else if (IsOneOf(*e, {"pose"})) {
        if (model.around == nullptr && !IsZero(*e))
          Warn(model.file, *e, "of the model is ignored: the scenario says where the vehicle starts",
               warnings);
      } else {
        Warn(model.file, *e, "not supported, ignored", warnings);
      }
    }
  for (const SdfPart& plugin : files_.plugins())
    if (!IsRead(files_, plugin, elements))
      Warn(plugin.file(), *plugin.element, "plugins are not supported, ignored", warnings);
  bool has_shape = false;
  for (const SdfPart& link : files_.links()) has_shape = WarnLink(link, warnings) || has_shape;
  if (const SdfPart* base = files_.Link(elements.base_link); base != nullptr && !has_shape)
    Warn(base->file(), *base->element,
         "no link has a usable collision shape: the box of uniform density with the main body's mass and "
         "inertia touches the ground",
         warnings);
  // The motion of other joints is not simulated.
  for (const SdfPart& joint : files_.joints())
    if (hinges.contains(joint.name))
      WarnJoint(joint,
                std::any_of(elements.servos.begin(), elements.servos.end(),
                            [&](const ServoElement& servo) {
                              return servo.joint == joint.name && servo.mode == ServoMode::kPosition;
                            }),
                warnings);
}

SdfPlace VehicleXml::Place(std::string_view tag, std::string_view name, const char* child) const {
  const SdfPart* part = tag == "link" ? files_.Link(name) : tag == "joint" ? files_.Joint(name) : nullptr;
  if (part == nullptr) return {files_.file(), files_.models().front().element->GetLineNum()};
  if (child == nullptr) return {part->file(), part->line()};
  // A child, or a grandchild such as inertial/inertia.
  for (const auto* c = part->element->FirstChildElement(); c != nullptr; c = c->NextSiblingElement()) {
    if (std::string_view(c->Name()) == child) return {part->file(), c->GetLineNum()};
    if (const auto* g = c->FirstChildElement(child)) return {part->file(), g->GetLineNum()};
  }
  return {part->file(), part->line()};
}

}  // namespace tiltproof::plant
