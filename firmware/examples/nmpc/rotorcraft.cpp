#include "firmware/examples/nmpc/rotorcraft.h"

#include <array>
#include <cstddef>
#include <nlohmann/json.hpp>

namespace tiltproof::nmpc {
namespace {

using Json = nlohmann::json;

// Each of these throws Json::exception for what is missing or has another type.

Eigen::Vector3d VectorAt(const Json& parent, const char* key) {
  const auto numbers = parent.at(key).get<std::array<double, 3>>();
  return {numbers[0], numbers[1], numbers[2]};
}

Body ReadBody(const Json& json) {
  Body body = {.mass_kg = json.at("mass_kg").get<double>(), .p_com_m = VectorAt(json, "com_m")};
  const auto [xx, yy, zz, xy, xz, yz] = json.at("inertia_kg_m2").get<std::array<double, 6>>();
  body.inertia_kg_m2 << xx, xy, xz, xy, yy, yz, xz, yz, zz;
  return body;
}

TiltHinge ReadHinge(const Json& json) {
  return {.body = ReadBody(json.at("body")),
          .p_hinge_m = VectorAt(json, "point_m"),
          .axis = VectorAt(json, "axis"),
          .angle_min_rad = json.at("angle_min_rad").get<double>(),
          .angle_max_rad = json.at("angle_max_rad").get<double>()};
}

Propeller ReadRotor(const Json& json) {
  const Json& hinge = json.at("hinge");
  return {.hinge = hinge.is_null() ? -1 : hinge.get<int>(),
          .p_rotor_m = VectorAt(json, "point_m"),
          .axis = VectorAt(json, "axis"),
          .drag_ratio_m = json.at("drag_ratio_m").get<double>()};
}

Rotorcraft ReadAll(const Json& json) {
  Rotorcraft vehicle;
  vehicle.period_s = json.at("control_period_s").get<double>();
  const Json& geometry = json.at("geometry");
  vehicle.base = ReadBody(geometry.at("base"));
  for (const Json& hinge : geometry.at("hinges")) vehicle.hinges.push_back(ReadHinge(hinge));
  for (const Json& rotor : geometry.at("rotors")) vehicle.rotors.push_back(ReadRotor(rotor));
  for (const Json& input : json.at("inputs")) {
    vehicle.input_min.push_back(input.at("min").get<double>());
    vehicle.input_max.push_back(input.at("max").get<double>());
    vehicle.input_hover.push_back(input.at("hover").get<double>());
  }
  const Json& states = json.at("states");
  vehicle.roll_hover_rad = states.at(3).at("hover").get<double>();
  vehicle.pitch_hover_rad = states.at(4).at("hover").get<double>();
  for (std::size_t i = 0; i < vehicle.hinges.size(); ++i)
    vehicle.hinge_hover_rad.push_back(states.at(6 + i).at("hover").get<double>());
  return vehicle;
}

bool IsSound(const Rotorcraft& vehicle) {
  bool is_sound =
      vehicle.period_s > 0 && vehicle.input_hover.size() == vehicle.rotors.size() + vehicle.hinges.size();
  for (const Propeller& rotor : vehicle.rotors)
    is_sound = is_sound && rotor.hinge >= -1 && rotor.hinge < static_cast<int>(vehicle.hinges.size());
  for (const TiltHinge& hinge : vehicle.hinges)
    is_sound = is_sound && hinge.angle_min_rad < hinge.angle_max_rad;
  for (std::size_t i = 0; i < vehicle.input_hover.size(); ++i)
    is_sound = is_sound && vehicle.input_min[i] < vehicle.input_max[i];
  return is_sound;
}

}  // namespace

std::optional<Rotorcraft> ReadRotorcraft(const char* parameters, std::string& problem) {
  try {
    const Json json = Json::parse(parameters == nullptr ? "" : parameters);
    for (const Json& hinge : json.at("geometry").at("hinges"))
      if (hinge.at("servo") != "torque") {
        problem = "the vehicle has a position servo; this firmware commands torques only";
        return std::nullopt;
      }
    const Rotorcraft vehicle = ReadAll(json);
    if (IsSound(vehicle)) return vehicle;
    problem = "the parameters describe no vehicle";
  } catch (const Json::exception& error) {
    problem = std::string("the parameters describe no vehicle: ") + error.what();
  }
  return std::nullopt;
}

}  // namespace tiltproof::nmpc
