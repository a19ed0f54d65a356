#include "plant/missing_elements.h"

#include <fmt/core.h>

#include <algorithm>
#include <sstream>
#include <string_view>
#include <vector>

namespace tiltproof::plant {
namespace {

using tinyxml2::XMLElement;

struct Hinge {
  std::string joint, parent, child;
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

// The first two joints, the right one first, if the links' poses tell; placeholders for what is not there.
std::vector<Hinge> Hinges(const XMLElement& model) {
  std::vector<Hinge> hinges;
  for (const auto* e = model.FirstChildElement("joint"); e != nullptr && hinges.size() < 2;
       e = e->NextSiblingElement("joint")) {
    const char* name = e->Attribute("name");
    const std::string child = TextOf(e->FirstChildElement("child"));
    hinges.push_back({name == nullptr ? "JOINT" : name, LinkOr(model, TextOf(e->FirstChildElement("parent"))),
                      LinkOr(model, child), YOf(FindLink(model, child))});
  }
  hinges.resize(2, {"JOINT", "LINK", "LINK", 0});
  if (hinges[0].y_m > hinges[1].y_m) std::swap(hinges[0], hinges[1]);
  return hinges;
}

}  // namespace

std::string MissingElements(const XMLElement& model, const VehicleElements& present) {
  const std::vector<Hinge> hinges = Hinges(model);
  const bool has_none = present.file.empty();
  std::string text;
  const auto add = [&](const std::string& element) {
    text += fmt::format("{}{}\n", has_none ? "      " : "    ", element);
  };
  if (present.base_link.empty()) add(fmt::format("<tiltproof:base link=\"{}\"/>", hinges[0].parent));
  std::size_t thruster_count = present.thrusters.size(), servo_count = present.servos.size();
  // The one that is there, if one is, decides what the other is called.
  bool is_right = thruster_count == 0 || present.thrusters[0].name != "right";
  for (const Hinge& hinge : hinges) {
    const bool is_there = std::any_of(present.thrusters.begin(), present.thrusters.end(),
                                      [&](const ThrusterElement& t) { return t.link == hinge.child; });
    if (is_there || thruster_count >= 2) continue;
    ++thruster_count;
    add(
        fmt::format("<tiltproof:thruster name=\"{}\" link=\"{}\" axis=\"0 0 1\" direction=\"{}\" "
                    "drag_ratio_m=\"0.0179\" force_min_n=\"0\" force_max_n=\"30\"/>",
                    is_right ? "right" : "left", hinge.child, is_right ? 1 : -1));
    is_right = false;
  }
  for (const Hinge& hinge : hinges) {
    const bool is_there = std::any_of(present.servos.begin(), present.servos.end(),
                                      [&](const ServoElement& s) { return s.joint == hinge.joint; });
    if (is_there || servo_count >= 2) continue;
    ++servo_count;
    add(fmt::format("<tiltproof:servo joint=\"{}\" torque_max_nm=\"2\"/>", hinge.joint));
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
