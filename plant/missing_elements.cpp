#include "plant/missing_elements.h"

#include <fmt/core.h>

#include <algorithm>
#include <sstream>
#include <string_view>
#include <vector>

namespace tiltproof::plant {
namespace {

using tinyxml2::XMLElement;

struct Connection {
  std::string joint, parent, child;
  bool is_hinge = true;
  double y_m = 0;  // of the child
};

std::string TextOf(const XMLElement* element) {
  const char* text = element == nullptr ? nullptr : element->GetText();
  return text == nullptr ? std::string() : text;
}

const XMLElement* FindLink(const XMLElement& model, const std::string& name) {
  for (const auto* e = model.FirstChildElement("link"); e != nullptr; e = e->NextSiblingElement("link"))
    if (e->Attribute("name", name.c_str()) != nullptr) return e;
  return nullptr;
}

double YOf(const XMLElement* link) {
  std::istringstream pose(link == nullptr ? "" : TextOf(link->FirstChildElement("pose")));
  double x_m = 0, y_m = 0;
  return pose >> x_m >> y_m ? y_m : 0;
}

// A link's name, if there is such a link.
std::string LinkOr(const XMLElement& model, const std::string& name) {
  return FindLink(model, name) == nullptr ? "LINK" : name;
}

// All joints; of two, the right one first, if the links' poses tell. Placeholders where there is none.
std::vector<Connection> Connections(const XMLElement& model) {
  std::vector<Connection> connections;
  for (const auto* e = model.FirstChildElement("joint"); e != nullptr; e = e->NextSiblingElement("joint")) {
    const char* name = e->Attribute("name");
    const std::string child = TextOf(e->FirstChildElement("child"));
    connections.push_back({.joint = name == nullptr ? "JOINT" : name,
                           .parent = LinkOr(model, TextOf(e->FirstChildElement("parent"))),
                           .child = LinkOr(model, child),
                           .is_hinge = e->Attribute("type", "fixed") == nullptr,
                           .y_m = YOf(FindLink(model, child))});
  }
  if (connections.empty()) connections.resize(2, {"JOINT", "LINK", "LINK", true, 0});
  if (connections.size() == 2 && connections[0].y_m > connections[1].y_m)
    std::swap(connections[0], connections[1]);
  return connections;
}

}  // namespace

std::string MissingElements(const XMLElement& model, const VehicleElements& present) {
  const std::vector<Connection> connections = Connections(model);
  const bool has_none = present.file.empty();
  std::string text;
  const auto add = [&](const std::string& element) {
    text += fmt::format("{}{}\n", has_none ? "      " : "    ", element);
  };
  if (present.base_link.empty()) add(fmt::format("<tiltproof:base link=\"{}\"/>", connections[0].parent));
  // The thruster of a pair that is there, if one is, decides what the other is called.
  const bool is_pair = connections.size() == 2;
  bool is_right = present.thrusters.empty() || present.thrusters[0].name != "right";
  double direction = is_right ? 1 : -1;
  // A name that does not exist is one that was mistyped.
  const bool thrusters_exist =
      std::all_of(present.thrusters.begin(), present.thrusters.end(),
                  [&](const ThrusterElement& each) { return FindLink(model, each.link) != nullptr; });
  const bool servos_exist =
      std::all_of(present.servos.begin(), present.servos.end(), [&](const ServoElement& each) {
        return std::any_of(connections.begin(), connections.end(),
                           [&](const Connection& connection) { return connection.joint == each.joint; });
      });
  for (const Connection& connection : connections) {
    const bool is_there =
        std::any_of(present.thrusters.begin(), present.thrusters.end(),
                    [&](const ThrusterElement& each) { return each.link == connection.child; });
    const bool carries = std::any_of(connections.begin(), connections.end(), [&](const Connection& other) {
      return other.parent == connection.child && other.child != connection.child;
    });
    const bool is_mistyped =
        !present.thrusters.empty() && (!thrusters_exist || FindLink(model, connection.child) == nullptr);
    if (is_there || carries || is_mistyped) continue;
    add(
        fmt::format("<tiltproof:thruster name=\"{}\" link=\"{}\" axis=\"0 0 1\" direction=\"{}\" "
                    "drag_ratio_m=\"0.0179\" force_min_n=\"0\" force_max_n=\"30\"/>",
                    !is_pair   ? connection.child
                    : is_right ? "right"
                               : "left",
                    connection.child, direction));
    is_right = false;
    direction = -direction;
  }
  for (const Connection& connection : connections) {
    const bool is_there = std::any_of(present.servos.begin(), present.servos.end(),
                                      [&](const ServoElement& s) { return s.joint == connection.joint; });
    if (connection.is_hinge && !is_there && servos_exist)
      add(fmt::format("<tiltproof:servo joint=\"{}\" torque_max_nm=\"2\"/>", connection.joint));
  }
  if (text.empty()) return text;
  if (!has_none)
    return "to copy into <tiltproof:vehicle>, with the numbers of your vehicle:\n" +
           text.substr(0, text.size() - 1);
  return "to copy into <model>, with the numbers of your vehicle:\n"
         "    <tiltproof:vehicle xmlns:tiltproof=\"urn:tiltproof:vehicle:1\">\n" +
         text + "    </tiltproof:vehicle>";
}

}  // namespace tiltproof::plant
