#include "plant/motor_plugins.h"

#include <fmt/core.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <initializer_list>

namespace tiltproof::plant {
namespace {

using tinyxml2::XMLElement;

// Filename or name of the plugin contains one of the texts.
bool IsPlugin(const SdfPart& plugin, std::initializer_list<std::string_view> texts) {
  const std::string all =
      AttributeOf(*plugin.element, "filename") + " " + AttributeOf(*plugin.element, "name");
  return std::any_of(texts.begin(), texts.end(),
                     [&](std::string_view text) { return all.find(text) != std::string::npos; });
}

std::string ChildText(const XMLElement& element, const char* name) {
  return TrimmedText(element.FirstChildElement(name));
}

// Nullopt when the child does not exist, or is no number: then it is a problem.
std::optional<double> ChildNumber(const SdfPart& plugin, const XMLElement& element, const char* name,
                                  std::vector<VehicleProblem>& problems) {
  const XMLElement* child = element.FirstChildElement(name);
  if (child == nullptr) return std::nullopt;
  const std::string text = TrimmedText(child);
  const std::optional<double> value = ParseNumber(text);
  if (value && std::isfinite(*value)) return value;
  problems.push_back(
      {plugin.file(), child->GetLineNum(), fmt::format("<{}> must be a number, is '{}'", name, text)});
  return std::nullopt;
}

// Time constants that the plugin has when a file states none.
constexpr double kPluginUp_s = 1.0 / 80, kPluginDown_s = 1.0 / 40;

RotorElement ReadMotorModel(const SdfFiles& files, const SdfPart& plugin,
                            std::vector<VehicleProblem>& problems) {
  const XMLElement& element = *plugin.element;
  const SdfModel& model = *plugin.model;
  RotorElement rotor{.file = plugin.file(), .line = plugin.line()};
  rotor.link = files.LinkNamed(model, ChildText(element, "linkName"));
  rotor.joint = model.scope + ChildText(element, "jointName");
  rotor.name = PartName(rotor.link);
  const std::string turning = ChildText(element, "turningDirection");
  if (turning == "ccw" || turning == "cw")
    rotor.direction = turning == "ccw" ? -1 : 1;
  else
    rotor.missing.emplace_back("direction");
  const std::optional<double> ratio_m = ChildNumber(plugin, element, "momentConstant", problems);
  rotor.drag_ratio_m = ratio_m.value_or(0);
  if (!ratio_m) rotor.missing.emplace_back("drag_ratio_m");
  const std::optional<double> speed_rad_s = ChildNumber(plugin, element, "maxRotVelocity", problems);
  const std::optional<double> constant_n_s2 = ChildNumber(plugin, element, "motorConstant", problems);
  if (speed_rad_s && constant_n_s2)
    rotor.force_max_n = *constant_n_s2 * *speed_rad_s * *speed_rad_s;
  else
    rotor.missing.emplace_back("force_max_n");
  if (const std::string text = ChildText(element, "reversible"); text == "true" || text == "1")
    rotor.force_min_n = -rotor.force_max_n;
  rotor.time_constant_up_s = ChildNumber(plugin, element, "timeConstantUp", problems).value_or(kPluginUp_s);
  rotor.time_constant_down_s =
      ChildNumber(plugin, element, "timeConstantDown", problems).value_or(kPluginDown_s);
  return rotor;
}

// Thrust and drag ratio of a propeller whose blades are LiftDrag plugins, at rest in still air: the lift
// 0.5 density area cla a0 (speed r)^2 of each blade, with its centre of pressure at the radius r.
void AddBlades(const SdfFiles& files, double speed_rad_s, RotorElement& rotor,
               std::vector<VehicleProblem>& problems) {
  double lift_n = 0, torque_nm = 0;
  for (const SdfPart& plugin : files.plugins()) {
    const XMLElement& blade = *plugin.element;
    if (!IsPlugin(plugin, {"LiftDrag", "lift-drag"}) ||
        files.LinkNamed(*plugin.model, ChildText(blade, "link_name")) != rotor.link)
      continue;
    const auto number = [&](const char* name) { return ChildNumber(plugin, blade, name, problems); };
    const std::vector<std::string> cp = Words(ChildText(blade, "cp"));
    const auto a0 = number("a0"), cla = number("cla"), cda = number("cda"), area_m2 = number("area"),
               density_kg_m3 = number("air_density");
    if (cp.size() != 3 || !a0 || !cla || !cda || !area_m2 || !density_kg_m3) return;
    const double radius_m = std::hypot(ParseNumber(cp[0]).value_or(NAN), ParseNumber(cp[1]).value_or(NAN));
    const double pressure_pa = 0.5 * *density_kg_m3 * speed_rad_s * speed_rad_s * radius_m * radius_m;
    lift_n += pressure_pa * *area_m2 * *cla * *a0;
    torque_nm += pressure_pa * *area_m2 * std::abs(*cda * *a0) * radius_m;
  }
  if (!(lift_n > 0) || !std::isfinite(torque_nm)) return;
  rotor.force_max_n = lift_n;
  rotor.drag_ratio_m = torque_nm / lift_n;
  std::erase(rotor.missing, "force_max_n");
  std::erase(rotor.missing, "drag_ratio_m");
}

// ArduPilotPlugin: each <control> of a joint by its speed is a propeller.
void AddArduPilot(const SdfFiles& files, const SdfPart& plugin, std::vector<RotorElement>& rotors,
                  std::vector<VehicleProblem>& problems) {
  for (const auto* e = plugin.element->FirstChildElement("control"); e != nullptr;
       e = e->NextSiblingElement("control")) {
    if (ChildText(*e, "type") != "VELOCITY") continue;
    const SdfPart* joint = files.Joint(plugin.model->scope + ChildText(*e, "jointName"));
    if (joint == nullptr) continue;
    RotorElement rotor{.file = plugin.file(), .line = e->GetLineNum()};
    rotor.link = files.LinkNamed(*joint->model, ChildText(*joint->element, "child"));
    rotor.joint = joint->name;
    rotor.name = PartName(rotor.link);
    rotor.missing = {"drag_ratio_m", "force_max_n"};
    if (const auto speed_rad_s = ChildNumber(plugin, *e, "multiplier", problems)) {
      rotor.direction = *speed_rad_s < 0 ? 1 : -1;
      AddBlades(files, *speed_rad_s, rotor, problems);
    } else {
      rotor.missing.insert(rotor.missing.begin(), "direction");
    }
    rotors.push_back(std::move(rotor));
  }
}

// ProVANT's plugins name the links that they push, and some the drag ratio.
void AddProvant(const SdfFiles& files, const SdfPart& plugin, std::vector<RotorElement>& rotors,
                std::vector<VehicleProblem>& problems) {
  struct Role {
    const char *tag, *name;
  };
  for (const Role& role :
       {Role{"LinkDir", "right"}, Role{"LinkFr", "right"}, Role{"LinkEsq", "left"}, Role{"LinkFl", "left"},
        Role{"Motor1", ""}, Role{"Motor2", ""}, Role{"Motor3", ""}, Role{"Motor4", ""}}) {
    const XMLElement* child = plugin.element->FirstChildElement(role.tag);
    if (child == nullptr) continue;
    RotorElement rotor{.file = plugin.file(), .line = child->GetLineNum(), .name = role.name};
    rotor.link = files.LinkNamed(*plugin.model, TrimmedText(child));
    if (rotor.name.empty()) rotor.name = PartName(rotor.link);
    const std::optional<double> ratio_m = ChildNumber(plugin, *plugin.element, "DragCte", problems);
    rotor.drag_ratio_m = ratio_m.value_or(0);
    rotor.missing = {"direction", "force_max_n"};
    if (!ratio_m) rotor.missing.insert(rotor.missing.begin() + 1, "drag_ratio_m");
    rotors.push_back(std::move(rotor));
  }
}

bool SaysPosition(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text.starts_with("position");
}

// An element of the plugin, or of a part of it, that moves the joint to an angle.
bool MovesToAngle(const SdfPart& plugin, const XMLElement& element, const std::string& joint) {
  const bool controls = IsPlugin(plugin, {"JointPositionController", "joint-position-controller"});
  for (const char* tag : {"joint_name", "jointName", "NameOfJoint"})
    for (const auto* e = element.FirstChildElement(tag); e != nullptr; e = e->NextSiblingElement(tag)) {
      if (plugin.model->scope + TrimmedText(e) != joint) continue;
      if (controls || SaysPosition(ChildText(element, "joint_control_type")) ||
          SaysPosition(ChildText(element, "type")) || SaysPosition(ChildText(element, "Modo")))
        return true;
    }
  for (const auto* e = element.FirstChildElement(); e != nullptr; e = e->NextSiblingElement())
    if (MovesToAngle(plugin, *e, joint)) return true;
  return false;
}

}  // namespace

std::vector<RotorElement> RotorsOfPlugins(const SdfFiles& files, std::vector<VehicleProblem>& problems) {
  std::vector<RotorElement> rotors;
  for (const SdfPart& plugin : files.plugins())
    if (IsPlugin(plugin, {"gazebo_motor_model", "multicopter-motor-model", "MulticopterMotorModel"}))
      rotors.push_back(ReadMotorModel(files, plugin, problems));
  if (!rotors.empty()) return rotors;
  for (const SdfPart& plugin : files.plugins()) {
    if (IsPlugin(plugin, {"ArduPilotPlugin"})) AddArduPilot(files, plugin, rotors, problems);
    if (IsPlugin(plugin, {"gazebo_ros_brushless", "gazebo_ros_aerodinamica", "gazebo_ros_Aerodinamica",
                          "gazebo_ros_QuadForces"}))
      AddProvant(files, plugin, rotors, problems);
  }
  return rotors;
}

std::optional<PositionPlugin> PositionPluginOf(const SdfFiles& files, const std::string& joint) {
  for (const SdfPart& plugin : files.plugins()) {
    if (!MovesToAngle(plugin, *plugin.element, joint)) continue;
    PositionPlugin found{.plugin = &plugin, .speed_max_rad_s = {}};
    // In this mode the largest command is a speed.
    if (const std::string mode = ChildText(*plugin.element, "use_velocity_commands");
        mode == "true" || mode == "1")
      found.speed_max_rad_s = ParseNumber(ChildText(*plugin.element, "cmd_max"));
    return found;
  }
  return std::nullopt;
}

}  // namespace tiltproof::plant
