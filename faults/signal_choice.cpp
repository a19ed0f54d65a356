#include "faults/signal_choice.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "faults/text.h"

namespace tiltproof::faults {
namespace {

std::size_t IndexOf(const SignalSetup& setup, std::string_view parameter, ParameterKind kind) {
  const std::string& name = setup.parameters.Text(parameter);
  const std::vector<std::string> names = SignalNames(setup.signals, kind);
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end())
    throw std::invalid_argument(Concat({"the vehicle has no ", parameter, " '", name, "'"}));
  return static_cast<std::size_t>(found - names.begin());
}

}  // namespace

ParameterInfo SensorParameter() {
  return {.name = "signal",
          .unit = "",
          .kind = ParameterKind::kSensor,
          .doc = "the sensor, by its trace column; for the tilt-rotor: x_m ... alpha_l_rad_s",
          .example = "z_m"};
}

ParameterInfo ActuatorParameter() {
  return {.name = "actuator",
          .unit = "",
          .kind = ParameterKind::kInput,
          .doc = "the thrust or servo torque; for the tilt-rotor: f_r, f_l, tau_r, tau_l",
          .example = "f_r"};
}

bool IsSignalName(std::string_view text) {
  const auto is_letter = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); };
  const auto fits = [&](char c) { return is_letter(c) || (c >= '0' && c <= '9') || c == '_'; };
  return !text.empty() && text.size() <= kSignalNameMax && is_letter(text.front()) &&
         std::all_of(text.begin(), text.end(), fits);
}

std::vector<std::string> SignalNames(const VehicleSignals& signals, ParameterKind kind) {
  std::vector<std::string> names;
  if (kind == ParameterKind::kSensor)
    for (const Signal& signal : signals.sensors) names.push_back(signal.name);
  if (kind == ParameterKind::kInput)
    for (const Signal& signal : signals.inputs)
      names.push_back(signal.name.substr(0, signal.name.rfind('_')));  // "f_r_n" -> "f_r"
  return names;
}

std::size_t SensorIndex(const SignalSetup& setup, std::string_view parameter) {
  return IndexOf(setup, parameter, ParameterKind::kSensor);
}

std::size_t ActuatorIndex(const SignalSetup& setup) {
  return IndexOf(setup, "actuator", ParameterKind::kInput);
}

}  // namespace tiltproof::faults
