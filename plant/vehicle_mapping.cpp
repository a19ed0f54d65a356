#include "plant/vehicle_mapping.h"

#include <fmt/core.h>

#include <algorithm>
#include <map>
#include <sdf/Link.hh>
#include <sdf/Model.hh>
#include <sdf/Root.hh>
#include <vector>

#include "plant/sdf_file.h"
#include "plant/vehicle_xml.h"

namespace tiltproof::plant {
namespace {

struct Connection {
  std::string joint, parent, child;
  bool is_hinge = true, spins = false;
  double y_m = 0;  // of the child
};

// The links' places across the vehicle, in the frame of its first link and with all joints at 0. Empty when the file
// does not tell.
std::map<std::string, double> PlacesAcross(const SdfFiles& files) {
  std::map<std::string, double> y_m;
  sdf::Root root;
  std::vector<VehicleProblem> problems;
  LoadSdf(files, {}, root, problems);
  const sdf::Model* model = root.Model();
  if (model == nullptr) return y_m;
  const std::string base = InnerName(files.CanonicalLink(files.models().front()));
  for (const SdfPart& part : files.links()) {
    const sdf::Link* link = model->LinkByName(InnerName(part.name));
    ignition::math::Pose3d pose;
    if (link != nullptr && link->SemanticPose().Resolve(pose, base).empty()) y_m[part.name] = pose.Pos().Y();
  }
  return y_m;
}

// A link's name, if there is such a link.
std::string LinkOr(const SdfFiles& files, const std::string& name) {
  return files.Link(name) == nullptr ? "LINK" : name;
}

bool RightFirst(const Connection& a, const Connection& b) { return a.y_m < b.y_m; }

// All joints; of two, the right one first, if the links' poses tell. Placeholders where there is none.
std::vector<Connection> Connections(const SdfFiles& files, const VehicleTree& tree) {
  std::map<std::string, double> y_m = PlacesAcross(files);
  std::vector<Connection> connections;
  for (const TreeJoint& joint : tree.joints()) {
    const bool turns = joint.type == "revolute" || joint.type == "continuous";
    connections.push_back(
        {.joint = joint.name(),
         .parent = LinkOr(files, joint.parent),
         .child = LinkOr(files, joint.child),
         .is_hinge = joint.type != "fixed" && !(joint.lower_rad && joint.lower_rad == joint.upper_rad),
         .spins = turns && !(joint.lower_rad && joint.upper_rad && *joint.upper_rad - *joint.lower_rad < 6.4),
         .y_m = y_m[joint.child]});
  }
  if (connections.empty()) connections.resize(2, {"JOINT", "LINK", "LINK", true, false, 0});
  if (connections.size() == 2) std::stable_sort(connections.begin(), connections.end(), RightFirst);
  return connections;
}

// The joints whose links may be rotors: those that spin, or else the ends of the tree.
std::vector<Connection> RotorJoints(const std::vector<Connection>& connections) {
  const bool any_spins = std::any_of(connections.begin(), connections.end(),
                                     [](const Connection& connection) { return connection.spins; });
  std::vector<Connection> rotors;
  for (const Connection& connection : connections) {
    const bool carries_another =
        std::any_of(connections.begin(), connections.end(), [&](const Connection& other) {
          return other.parent == connection.child && other.child != connection.child;
        });
    if (any_spins ? connection.spins : !carries_another) rotors.push_back(connection);
  }
  if (rotors.size() == 2) std::stable_sort(rotors.begin(), rotors.end(), RightFirst);
  return rotors;
}

constexpr const char* kFillIn = "FILL_IN";

std::string NumberOrMark(const std::vector<std::string>& missing, const char* name, double value) {
  return std::find(missing.begin(), missing.end(), name) != missing.end() ? kFillIn
                                                                          : fmt::format("{:.10g}", value);
}

// Rotors that no plugin names. Two of them are right and left.
std::vector<RotorElement> Candidates(const SdfFiles& files, const VehicleTree& tree) {
  std::vector<RotorElement> rotors;
  for (const Connection& connection : RotorJoints(Connections(files, tree))) {
    if (files.Link(connection.child) == nullptr) continue;
    rotors.push_back({.file = files.file(),
                      .line = 0,
                      .name = PartName(connection.child),
                      .link = connection.child,
                      .missing = {"direction", "drag_ratio_m", "force_max_n"}});
    if (connection.spins) rotors.back().joint = connection.joint;
  }
  if (rotors.size() == 2) {
    rotors[0].name = "right";
    rotors[1].name = "left";
  }
  return rotors;
}

// True when a rotor or servo that plugins and joints describe has no limit.
bool LacksNumbers(const VehicleElements& elements) {
  return std::any_of(elements.rotors.begin(), elements.rotors.end(),
                     [](const RotorElement& rotor) { return !rotor.missing.empty(); }) ||
         std::any_of(elements.servos.begin(), elements.servos.end(), [](const ServoElement& servo) {
           return servo.mode == ServoMode::kPosition ? !(servo.speed_max_rad_s.value_or(0) > 0)
                                                     : !servo.torque_max_nm;
         });
}

std::string RotorText(const RotorElement& rotor) {
  const auto number = [&](const char* name, double value) {
    return NumberOrMark(rotor.missing, name, value);
  };
  return fmt::format(
      "  <tiltproof:rotor name=\"{}\" link=\"{}\" axis=\"{:.10g} {:.10g} {:.10g}\" direction=\"{}\"\n"
      "                   drag_ratio_m=\"{}\" force_min_n=\"{:.10g}\" force_max_n=\"{}\" "
      "time_constant_s=\"{:.10g}\"{}/>\n",
      rotor.name, rotor.link, rotor.axis.x(), rotor.axis.y(), rotor.axis.z(),
      number("direction", rotor.direction), number("drag_ratio_m", rotor.drag_ratio_m), rotor.force_min_n,
      number("force_max_n", rotor.force_max_n), rotor.time_constant_up_s,
      rotor.time_constant_down_s == rotor.time_constant_up_s
          ? ""
          : fmt::format(" time_constant_down_s=\"{:.10g}\"", rotor.time_constant_down_s));
}

std::string ServoText(const ServoElement& servo, const TreeJoint* joint) {
  const double torque_nm = servo.torque_max_nm.value_or(joint == nullptr ? 0 : joint->effort);
  const double speed_rad_s = servo.speed_max_rad_s.value_or(0) > 0 ? *servo.speed_max_rad_s
                             : joint == nullptr                    ? 0
                                                                   : joint->velocity;
  const auto number = [](double value) { return value > 0 ? fmt::format("{:.10g}", value) : kFillIn; };
  if (servo.mode == ServoMode::kTorque)
    return fmt::format("  <tiltproof:servo joint=\"{}\" torque_max_nm=\"{}\"/>\n", servo.joint,
                       number(torque_nm));
  return fmt::format(
      "  <tiltproof:servo joint=\"{}\" mode=\"position\" speed_max_rad_s=\"{}\" "
      "time_constant_s=\"{:.10g}\"/>\n",
      servo.joint, number(speed_rad_s), servo.time_constant_s);
}

}  // namespace

std::string VehicleMapping(const std::filesystem::path& file) {
  const VehicleXml xml(file);
  const SdfFiles& files = xml.files();
  std::vector<VehicleProblem> problems;
  xml.Check(problems);
  if (!problems.empty()) throw VehicleError(problems);
  std::vector<std::string> warnings;
  VehicleElements elements = ReadElements(files, {}, warnings, problems);
  VehicleTree tree(files);
  const bool are_complete = std::all_of(elements.rotors.begin(), elements.rotors.end(),
                                        [](const RotorElement& rotor) { return rotor.missing.empty(); });
  const bool from_motor_models = elements.from_plugins && are_complete;
  if (elements.rotors.empty()) {
    elements.rotors = Candidates(files, tree);
    elements.from_plugins = true;
  }
  if (elements.base_link.empty()) elements.base_link = files.CanonicalLink(files.models().front());
  // The elements' own problems are what the user fills in.
  problems.clear();
  tree.Assign(elements, problems);
  std::string text = fmt::format(
      "<?xml version=\"1.0\"?>\n"
      "<!-- The rotors and servos of {0}. Replace each {1} by a number of your vehicle (docs/vehicle.md), "
      "then\n"
      "     `tiltproof vehicle {0}` prints what tiltproof flies. -->\n"
      "<tiltproof:vehicle xmlns:tiltproof=\"urn:tiltproof:vehicle:1\">\n"
      "  <tiltproof:base link=\"{2}\"/>\n",
      file.filename().string(), kFillIn, elements.base_link);
  for (const RotorElement& rotor : elements.rotors)
    text += from_motor_models ? fmt::format("  <!-- rotor {}: from the motor plugin of line {} -->\n",
                                            rotor.name, rotor.line)
                              : RotorText(rotor);
  for (const ServoElement& servo : elements.servos) text += ServoText(servo, tree.Joint(servo.joint));
  return text + "</tiltproof:vehicle>\n";
}

std::string MissingElements(const SdfFiles& files, const VehicleTree& tree, const VehicleElements& present) {
  const std::string command = fmt::format(
      "`tiltproof vehicle {} --mapping` writes {} with all that was found and a marked place for "
      "each missing number",
      files.file().string(), MappingBeside(files.file()).filename().string());
  if (present.from_plugins) return LacksNumbers(present) ? command : "";
  const std::vector<Connection> connections = Connections(files, tree);
  const bool has_none = present.file.empty();
  std::string text;
  const auto add = [&](const std::string& element) {
    text += fmt::format("{}{}\n", has_none ? "      " : "    ", element);
  };
  if (present.base_link.empty()) add(fmt::format("<tiltproof:base link=\"{}\"/>", connections[0].parent));
  const std::vector<Connection> rotor_joints = RotorJoints(connections);
  // The rotor of a pair that is there, if one is, decides what the other is called.
  const bool is_pair = rotor_joints.size() == 2;
  bool is_right = present.rotors.empty() || present.rotors[0].name != "right";
  double direction = is_right ? 1 : -1;
  // A name that does not exist is one that was mistyped.
  const bool rotors_exist =
      std::all_of(present.rotors.begin(), present.rotors.end(),
                  [&](const RotorElement& each) { return files.Link(each.link) != nullptr; });
  const bool servos_exist =
      std::all_of(present.servos.begin(), present.servos.end(),
                  [&](const ServoElement& each) { return tree.Joint(each.joint) != nullptr; });
  for (const Connection& connection : rotor_joints) {
    const bool is_there =
        std::any_of(present.rotors.begin(), present.rotors.end(),
                    [&](const RotorElement& each) { return each.link == connection.child; });
    const bool is_mistyped =
        !present.rotors.empty() && (!rotors_exist || files.Link(connection.child) == nullptr);
    if (is_there || is_mistyped) continue;
    add(
        fmt::format("<tiltproof:rotor name=\"{}\" link=\"{}\" axis=\"0 0 1\" direction=\"{}\" "
                    "drag_ratio_m=\"0.0179\" force_min_n=\"0\" force_max_n=\"30\"/>",
                    !is_pair   ? PartName(connection.child)
                    : is_right ? "right"
                               : "left",
                    connection.child, direction));
    is_right = false;
    direction = -direction;
  }
  for (const Connection& connection : connections) {
    const bool is_there = std::any_of(present.servos.begin(), present.servos.end(),
                                      [&](const ServoElement& s) { return s.joint == connection.joint; });
    if (connection.is_hinge && !connection.spins && !is_there && servos_exist)
      add(fmt::format("<tiltproof:servo joint=\"{}\" torque_max_nm=\"2\"/>", connection.joint));
  }
  if (text.empty()) return text;
  if (!has_none)
    return "to copy into <tiltproof:vehicle>, with the numbers of your vehicle:\n" +
           text.substr(0, text.size() - 1);
  return command +
         ". Or copy into <model>, with the numbers of your vehicle:\n"
         "    <tiltproof:vehicle xmlns:tiltproof=\"urn:tiltproof:vehicle:1\">\n" +
         text + "    </tiltproof:vehicle>";
}

}  // namespace tiltproof::plant
