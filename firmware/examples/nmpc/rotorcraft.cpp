#include "firmware/examples/nmpc/rotorcraft.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <string_view>

#include "firmware/ports/host/json.h"

namespace tiltproof::nmpc {
namespace {

using firmware::Json;

bool ReadNumbers(const Json& parent, std::string_view key, std::span<double> into) {
  const Json* list = parent.Find(key);
  if (list == nullptr || list->items.size() != into.size()) return false;
  for (std::size_t i = 0; i < into.size(); ++i) {
    const auto value = list->items[i].As<double>();
    if (!value || !std::isfinite(*value)) return false;
    into[i] = *value;
  }
  return true;
}
bool ReadVector(const Json& parent, std::string_view key, Eigen::Vector3d& to) {
  return ReadNumbers(parent, key, {to.data(), 3});
}

bool ReadBody(const Json* json, Body& body) {
  std::array<double, 6> inertia{};  // xx yy zz xy xz yz
  const auto mass = json == nullptr ? std::nullopt : json->NumberAt<double>("mass_kg");
  if (!mass || !ReadVector(*json, "com_m", body.p_com_m) || !ReadNumbers(*json, "inertia_kg_m2", inertia))
    return false;
  body.mass_kg = *mass;
  body.inertia_kg_m2 << inertia[0], inertia[3], inertia[4], inertia[3], inertia[1], inertia[5], inertia[4],
      inertia[5], inertia[2];
  return true;
}

bool ReadHinge(const Json& json, TiltHinge& hinge) {
  const auto min = json.NumberAt<double>("angle_min_rad"), max = json.NumberAt<double>("angle_max_rad");
  if (!min || !max || !(*min < *max)) return false;
  hinge.angle_min_rad = *min;
  hinge.angle_max_rad = *max;
  return ReadBody(json.Find("body"), hinge.body) && ReadVector(json, "point_m", hinge.p_hinge_m) &&
         ReadVector(json, "axis", hinge.axis);
}

bool ReadRotor(const Json& json, std::size_t hinge_count, Propeller& rotor) {
  const auto hinge = json.NumberAt<int>("hinge");
  const auto drag_ratio_m = json.NumberAt<double>("drag_ratio_m");
  rotor.hinge = hinge.value_or(-1);
  if (!drag_ratio_m || rotor.hinge < -1 || rotor.hinge >= static_cast<int>(hinge_count)) return false;
  rotor.drag_ratio_m = *drag_ratio_m;
  return ReadVector(json, "point_m", rotor.p_rotor_m) && ReadVector(json, "axis", rotor.axis);
}

bool ReadGeometry(const Json& geometry, Rotorcraft& vehicle) {
  const Json *hinges = geometry.Find("hinges"), *rotors = geometry.Find("rotors");
  if (hinges == nullptr || rotors == nullptr || !ReadBody(geometry.Find("base"), vehicle.base)) return false;
  for (const Json& json : hinges->items)
    if (!ReadHinge(json, vehicle.hinges.emplace_back())) return false;
  for (const Json& json : rotors->items)
    if (!ReadRotor(json, vehicle.hinges.size(), vehicle.rotors.emplace_back())) return false;
  return true;
}

bool ReadInputs(const Json& inputs, Rotorcraft& vehicle) {
  for (const Json& input : inputs.items) {
    const auto min = input.NumberAt<double>("min"), max = input.NumberAt<double>("max"),
               hover = input.NumberAt<double>("hover");
    if (!min || !max || !hover || !(*min < *max)) return false;
    vehicle.input_min.push_back(*min);
    vehicle.input_max.push_back(*max);
    vehicle.input_hover.push_back(*hover);
  }
  return inputs.items.size() == vehicle.rotors.size() + vehicle.hinges.size();
}

bool ReadHover(const Json& states, Rotorcraft& vehicle) {
  std::vector<double> hover;
  for (const Json& state : states.items) hover.push_back(state.NumberAt<double>("hover").value_or(0));
  if (hover.size() != 12 + 2 * vehicle.hinges.size()) return false;
  vehicle.roll_hover_rad = hover[3];
  vehicle.pitch_hover_rad = hover[4];
  vehicle.hinge_hover_rad.assign(hover.begin() + 6,
                                 hover.begin() + 6 + static_cast<long>(vehicle.hinges.size()));
  return true;
}

}  // namespace

std::optional<Rotorcraft> ReadRotorcraft(const char* parameters, std::string& problem) {
  const std::optional<Json> json = parameters == nullptr ? std::nullopt : firmware::ParseJson(parameters);
  const auto find = [&](std::string_view key) { return json ? json->Find(key) : nullptr; };
  const Json *geometry = find("geometry"), *inputs = find("inputs"), *states = find("states");
  const auto period_s = json ? json->NumberAt<double>("control_period_s") : std::nullopt;
  if (geometry == nullptr || inputs == nullptr || states == nullptr || !period_s || !(*period_s > 0)) {
    problem = "the parameters have no geometry of the vehicle";
    return std::nullopt;
  }
  if (const Json* hinges = geometry->Find("hinges"))
    for (const Json& hinge : hinges->items)
      if (hinge.TextAt("servo") != "torque") {
        problem = "the vehicle has a position servo; this firmware commands torques only";
        return std::nullopt;
      }
  Rotorcraft vehicle;
  vehicle.period_s = *period_s;
  if (!ReadGeometry(*geometry, vehicle) || !ReadInputs(*inputs, vehicle) || !ReadHover(*states, vehicle)) {
    problem = "the geometry, the inputs or the states of the vehicle are incomplete";
    return std::nullopt;
  }
  return vehicle;
}

}  // namespace tiltproof::nmpc
