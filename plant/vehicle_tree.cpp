#include "plant/vehicle_tree.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "plant/motor_plugins.h"

namespace tiltproof::plant {
namespace {

using tinyxml2::XMLElement;

std::optional<double> Limit(const XMLElement* axis, const char* name) {
  const XMLElement* limit = axis == nullptr ? nullptr : axis->FirstChildElement("limit");
  const XMLElement* value = limit == nullptr ? nullptr : limit->FirstChildElement(name);
  return value == nullptr ? std::nullopt : ParseNumber(TrimmedText(value));
}

// SDF's negative and infinite values mean that there is no limit.
double Positive(std::optional<double> value) { return value && *value > 0 && *value < 1e6 ? *value : 0; }

// Stops within one turn. A propeller has none, or some at 1e16.
bool HasStops(const TreeJoint& joint) {
  return joint.lower_rad && joint.upper_rad && *joint.upper_rad - *joint.lower_rad < 6.4;
}

const ServoElement* ServoOf(const VehicleElements& elements, const std::string& joint) {
  for (const ServoElement& servo : elements.servos)
    if (servo.joint == joint) return &servo;
  return nullptr;
}

int AxisLine(const TreeJoint& joint) {
  const XMLElement* axis = joint.part->element->FirstChildElement("axis");
  return axis == nullptr ? joint.part->line() : axis->GetLineNum();
}

// The servo of a hinge by the limits of its joint.
ServoElement ServoOfLimits(const SdfFiles& files, const TreeJoint& joint,
                           std::vector<VehicleProblem>& problems) {
  ServoElement servo{.file = joint.part->file(), .line = joint.part->line(), .joint = joint.name()};
  if (joint.effort > 0) servo.torque_max_nm = joint.effort;
  const auto complain = [&](std::string_view missing) {
    problems.push_back({servo.file, servo.line,
                        fmt::format("joint '{}' is a hinge that carries a rotor, and its servo has no limit: "
                                    "{}, or a <tiltproof:servo>",
                                    servo.joint, missing)});
  };
  const std::optional<PositionPlugin> plugin = PositionPluginOf(files, joint.name());
  if (!plugin) {
    if (!servo.torque_max_nm) complain("state its torque as <effort>");
    return servo;
  }
  servo.mode = ServoMode::kPosition;
  servo.speed_max_rad_s = Positive(plugin->speed_max_rad_s) > 0 ? plugin->speed_max_rad_s : joint.velocity;
  if (!(*servo.speed_max_rad_s > 0))
    complain(fmt::format("the plugin of line {} moves it to an angle, so state its speed as <velocity>",
                         plugin->plugin->line()));
  return servo;
}

}  // namespace

VehicleTree::VehicleTree(const SdfFiles& files) : files_(files) {
  for (const SdfPart& part : files.joints()) {
    const XMLElement& e = *part.element;
    const XMLElement* axis = e.FirstChildElement("axis");
    joints_.push_back({.part = &part,
                       .type = AttributeOf(e, "type"),
                       .parent = files.LinkNamed(*part.model, TrimmedText(e.FirstChildElement("parent"))),
                       .child = files.LinkNamed(*part.model, TrimmedText(e.FirstChildElement("child"))),
                       .lower_rad = Limit(axis, "lower"),
                       .upper_rad = Limit(axis, "upper"),
                       .effort = Positive(Limit(axis, "effort")),
                       .velocity = Positive(Limit(axis, "velocity"))});
  }
}

const TreeJoint* VehicleTree::Joint(const std::string& name) const {
  for (const TreeJoint& joint : joints_)
    if (joint.name() == name) return &joint;
  return nullptr;
}

std::vector<const TreeJoint*> VehicleTree::JointsTo(const std::string& link) const {
  std::vector<const TreeJoint*> found;
  for (const TreeJoint& joint : joints_)
    if (joint.child == link) found.push_back(&joint);
  return found;
}

const TreeJoint* VehicleTree::HingeOf(const std::string& link) const {
  for (const TreeJoint& joint : joints_)
    if (joint.is_hinge && joint.child == link) return &joint;
  return nullptr;
}

std::set<std::string> VehicleTree::hinges() const {
  std::set<std::string> names;
  for (const TreeJoint& joint : joints_)
    if (joint.is_hinge) names.insert(joint.name());
  return names;
}

bool VehicleTree::IsRigid(const std::string& link) const {
  return !carriers_.empty() && link != base_ && HingeOf(link) == nullptr;
}

const std::string& VehicleTree::BodyOf(const std::string& link) const {
  const std::string* body = &link;
  while (*body != base_ && HingeOf(*body) == nullptr) body = &above_.at(*body);
  return *body;
}

void VehicleTree::Assign(VehicleElements& elements, std::vector<VehicleProblem>& problems) {
  FindBase(elements);
  base_ = elements.base_link;
  CheckRoles(elements, problems);
  if (!problems.empty()) return;
  CheckLinks(elements, problems);
  if (!problems.empty()) return;
  carriers_ = {base_};
  for (const RotorElement& rotor : elements.rotors) WalkUp(rotor, elements, problems);
  CheckServos(elements, problems);
  for (const SdfPart& link : files_.links())
    if (!carriers_.contains(link.name)) lumped_.push_back(link.name);
}

// Without tiltproof elements: the root of the tree that the canonical link is in.
void VehicleTree::FindBase(VehicleElements& elements) const {
  if (!elements.from_plugins || !elements.file.empty()) return;
  for (std::size_t i = 0; i < joints_.size(); ++i) {
    const auto joints = JointsTo(elements.base_link);
    if (joints.size() != 1 || files_.Link(joints[0]->parent) == nullptr) return;
    elements.base_link = joints[0]->parent;
  }
}

void VehicleTree::CheckRoles(const VehicleElements& elements, std::vector<VehicleProblem>& problems) const {
  const auto check_link = [&](const std::string& name, const std::filesystem::path& file, int line,
                              const char* role) {
    if (!name.empty() && files_.Link(name) == nullptr)
      problems.push_back({file, line, fmt::format("{} link '{}' does not exist in the model", role, name)});
  };
  check_link(elements.base_link, elements.file, elements.line, "base");
  for (const RotorElement& rotor : elements.rotors) {
    check_link(rotor.link, rotor.file, rotor.line, "rotor");
    if (!rotor.link.empty() && rotor.link == elements.base_link)
      problems.push_back({rotor.file, rotor.line, "the base cannot be a rotor"});
  }
  for (const ServoElement& servo : elements.servos) {
    if (servo.joint.empty()) continue;
    const TreeJoint* joint = Joint(servo.joint);
    const auto complain = [&](const std::string& message) {
      problems.push_back({servo.file, servo.line, message});
    };
    if (joint == nullptr) {
      complain(fmt::format("servo joint '{}' does not exist in the model", servo.joint));
    } else if (joint->type == "fixed") {
      complain(fmt::format("servo joint '{}' is fixed", servo.joint));
    } else if (joint->lower_rad && joint->lower_rad == joint->upper_rad) {
      complain(fmt::format("servo joint '{}' is fixed: its stops are equal", servo.joint));
    } else if (servo.mode == ServoMode::kTorque &&
               !(Positive(servo.torque_max_nm.value_or(joint->effort)) > 0 &&
                 servo.torque_max_nm.value_or(joint->effort) < 1e3)) {
      complain(fmt::format("servo of joint '{}' has no limit: give torque_max_nm here or <effort> there",
                           servo.joint));
    } else if (servo.mode == ServoMode::kPosition && !(servo.speed_max_rad_s.value_or(joint->velocity) > 0)) {
      complain(fmt::format("servo of joint '{}' has no limit: give speed_max_rad_s here or <velocity> there",
                           servo.joint));
    }
  }
}

// Each link but the base hangs on one joint, and by a chain of them on the base.
void VehicleTree::CheckLinks(const VehicleElements& elements, std::vector<VehicleProblem>& problems) {
  for (const SdfPart& link : files_.links()) {
    const auto joints = JointsTo(link.name);
    const auto complain = [&](const std::string& message) {
      problems.push_back({link.file(), link.line(), message});
    };
    if (link.name == elements.base_link) {
      if (!joints.empty())
        complain(fmt::format("the base '{}' is the child of joint '{}'", link.name, joints[0]->name()));
    } else if (joints.size() != 1) {
      complain(
          fmt::format("link '{}' must be the child of one joint, is that of {}", link.name, joints.size()));
    } else {
      above_[link.name] = joints[0]->parent;
    }
  }
  if (!problems.empty()) return;
  for (const SdfPart& link : files_.links()) {
    std::string at = link.name;
    for (std::size_t i = 0; i <= joints_.size() && at != elements.base_link; ++i) at = above_.at(at);
    if (at != elements.base_link)
      problems.push_back({link.file(), link.line(),
                          fmt::format("link '{}' does not hang on the base '{}': its joints are a circle",
                                      link.name, elements.base_link)});
  }
}

void VehicleTree::WalkUp(const RotorElement& rotor, VehicleElements& elements,
                         std::vector<VehicleProblem>& problems) {
  const TreeJoint* lower_hinge = nullptr;
  for (std::string at = rotor.link; at != base_; at = above_.at(at)) {
    carriers_.insert(at);
    auto& joint = *std::find_if(joints_.begin(), joints_.end(),
                                [&](const TreeJoint& each) { return each.child == at; });
    joint.is_hinge = joint.is_hinge || IsHinge(joint, rotor, elements, problems);
    if (!joint.is_hinge) continue;
    if (lower_hinge != nullptr)
      problems.push_back(
          {joint.part->file(), joint.part->line(),
           fmt::format("hinge '{}' carries the hinge '{}': a hinge must be on the base, so fix one of them "
                       "by equal stops",
                       joint.name(), lower_hinge->name())});
    lower_hinge = &joint;
  }
}

// A joint between the base and a rotor: a hinge, or rigid.
bool VehicleTree::IsHinge(const TreeJoint& joint, const RotorElement& rotor, VehicleElements& elements,
                          std::vector<VehicleProblem>& problems) const {
  const auto complain = [&](int line, const std::string& message) {
    problems.push_back({joint.part->file(), line, message});
  };
  const bool has_servo = ServoOf(elements, joint.name()) != nullptr;
  const bool turns = joint.type == "revolute" || joint.type == "continuous";
  if (joint.type == "fixed") return false;
  // A propeller: tiltproof does not simulate that it spins.
  const bool is_own = joint.child == rotor.link && !has_servo;
  if (is_own && turns && (joint.name() == rotor.joint || !HasStops(joint))) return false;
  if (joint.type != "revolute") {
    complain(joint.part->line(),
             fmt::format("joint '{}' must be of type revolute, or of type fixed: it carries the rotor '{}'",
                         joint.name(), rotor.name));
    return false;
  }
  if (joint.lower_rad && joint.lower_rad == joint.upper_rad) return false;
  const double lower_rad = joint.lower_rad.value_or(-INFINITY),
               upper_rad = joint.upper_rad.value_or(INFINITY);
  // ODE holds a stop within half a turn only.
  if (!(lower_rad <= 0 && upper_rad >= 0 && lower_rad > -3.1 && upper_rad < 3.1))
    complain(AxisLine(joint),
             fmt::format("joint '{}': the stops must be <lower> in (-3.1, 0] and <upper> in [0, 3.1) rad, "
                         "are {} and {}",
                         joint.name(), lower_rad, upper_rad));
  if (has_servo) return true;
  if (elements.from_plugins) {
    elements.servos.push_back(ServoOfLimits(files_, joint, problems));
  } else {
    problems.push_back({rotor.file, rotor.line,
                        fmt::format("no servo's joint has {} '{}' as its child",
                                    joint.child == rotor.link ? "rotor link" : "link", joint.child)});
  }
  return true;
}

void VehicleTree::CheckServos(const VehicleElements& elements, std::vector<VehicleProblem>& problems) const {
  for (const ServoElement& servo : elements.servos) {
    if (const ServoElement* first = ServoOf(elements, servo.joint); first != &servo)
      problems.push_back({servo.file, servo.line, fmt::format("a second servo of joint '{}'", servo.joint)});
    else if (const TreeJoint* joint = Joint(servo.joint); !carriers_.contains(joint->child))
      problems.push_back(
          {servo.file, servo.line, fmt::format("servo joint '{}' carries no rotor", servo.joint)});
  }
}

}  // namespace tiltproof::plant
