#include "faults/signal_choice.h"

#include <array>
#include <cstdlib>

namespace tiltproof::faults {
namespace {

// "f_r_n" -> "f_r"
constexpr std::string_view WithoutUnit(std::string_view column) {
  return column.substr(0, column.rfind('_'));
}

}  // namespace

ParameterInfo SensorParameter() {
  ParameterInfo info{.name = "signal",
                     .unit = "",
                     .kind = ParameterKind::kChoice,
                     .doc = "which sensor, by its trace column",
                     .example = "z_m"};
  for (const auto& field : kSensorFields) info.choices.push_back(field.column);
  return info;
}

ParameterInfo ActuatorParameter() {
  ParameterInfo info{.name = "actuator",
                     .unit = "",
                     .kind = ParameterKind::kChoice,
                     .doc = "which thrust or servo torque",
                     .example = "f_r"};
  for (const auto& field : kActuatorFields) info.choices.push_back(WithoutUnit(field.column));
  return info;
}

float Sensors::*SensorNamed(std::string_view name) {
  for (const auto& field : kSensorFields) {
    if (field.column == name) return field.in_float;
  }
  std::abort();
}

double ActuatorsTruth::*ActuatorNamed(std::string_view name) {
  for (const auto& field : kActuatorFields) {
    if (WithoutUnit(field.column) == name) return field.in_double;
  }
  std::abort();
}

}  // namespace tiltproof::faults
