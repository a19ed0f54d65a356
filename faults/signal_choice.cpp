#include "faults/signal_choice.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "faults/text.h"
#include "link/check.h"
#include "link/disturbance.h"

namespace tiltproof::faults {
namespace {

struct VectorOfSensors {
  std::string_view name;
  std::array<std::string_view, 3> components;
};
constexpr std::array<VectorOfSensors, 3> kVectors = {{{"position", {"x_m", "y_m", "z_m"}},
                                                      {"velocity", {"vx_m_s", "vy_m_s", "vz_m_s"}},
                                                      {"rates", {"wx_rad_s", "wy_rad_s", "wz_rad_s"}}}};
constexpr const VectorOfSensors& kPosition = kVectors[0];
constexpr const VectorOfSensors& kVelocity = kVectors[1];

bool Has(const VehicleSignals& signals, std::string_view sensor) {
  return signals.sensors.Find(sensor).has_value();
}

// Each once, in the order of the table.
std::vector<std::string> Groups(const VehicleSignals& signals) {
  std::vector<std::string> groups;
  for (const Signal& signal : signals.sensors)
    if (!signal.group.empty() && std::find(groups.begin(), groups.end(), signal.group) == groups.end())
      groups.push_back(signal.group);
  return groups;
}

std::invalid_argument NoSuchSignal(std::string_view parameter, std::string_view name) {
  return std::invalid_argument(Concat({"the vehicle has no ", parameter, " '", name, "'"}));
}

std::size_t IndexOf(const SignalSetup& setup, std::string_view parameter, ParameterKind kind) {
  const std::string& name = setup.parameters.Text(parameter);
  const std::vector<std::string> names = SignalNames(setup.signals, kind);
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end()) throw NoSuchSignal(parameter, name);
  return static_cast<std::size_t>(found - names.begin());
}

}  // namespace

ParameterInfo SensorParameter() {
  return {.name = "signal",
          .unit = "",
          .kind = ParameterKind::kSensorOrAll,
          .doc =
              "the sensor, by its trace column; for the tilt-rotor: x_m ... alpha_l_rad_s; `all`: every "
              "sensor, each by itself; acc, gyro, mag, gnss: those of a sensor in the vehicle's file",
          .example = "z_m"};
}

ParameterInfo OneSensorParameter() {
  ParameterInfo sensor = SensorParameter();
  sensor.kind = ParameterKind::kSensor;
  sensor.doc = "the sensor, by its trace column; for the tilt-rotor: x_m ... alpha_l_rad_s";
  return sensor;
}

ParameterInfo PositionParameter() {
  ParameterInfo position = SensorParameter();
  position.kind = ParameterKind::kPositionSensor;
  position.doc = "the position sensor, by its trace column: x_m, y_m or z_m";
  position.example = "x_m";
  return position;
}

ParameterInfo SensorVectorParameter() {
  return {.name = "signal",
          .unit = "",
          .kind = ParameterKind::kSensorVector,
          .doc =
              "the vector: position (x_m, y_m, z_m), velocity (vx_m_s, vy_m_s, vz_m_s) or rates (wx_rad_s, "
              "wy_rad_s, wz_rad_s); with sensors in the vehicle's file acc, gyro or mag",
          .example = "rates"};
}

ParameterInfo ActuatorParameter() {
  return {.name = "actuator",
          .unit = "",
          .kind = ParameterKind::kInput,
          .doc = "the thrust, or the torque or angle of a servo; for the tilt-rotor: f_r, f_l, tau_r, tau_l",
          .example = "f_r"};
}

ParameterInfo RotorParameter() {
  return {.name = "rotor",
          .unit = "",
          .kind = ParameterKind::kRotor,
          .doc = "the rotor, by its name in the vehicle's file; for the tilt-rotor: right, left",
          .example = "right"};
}

ParameterInfo JointParameter() {
  return {
      .name = "joint",
      .unit = "",
      .kind = ParameterKind::kJoint,
      .doc =
          "the servo's joint, by its name in the vehicle's file; for the tilt-rotor: hinge_right, hinge_left",
      .example = "hinge_right"};
}

bool IsSignalName(std::string_view text) {
  const auto is_letter = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); };
  const auto fits = [&](char c) { return is_letter(c) || (c >= '0' && c <= '9') || c == '_'; };
  return !text.empty() && text.size() <= kSignalNameMax && is_letter(text.front()) &&
         std::all_of(text.begin(), text.end(), fits);
}

std::vector<std::string> SignalNames(const VehicleSignals& signals, ParameterKind kind) {
  std::vector<std::string> names;
  if (kind == ParameterKind::kSensor || kind == ParameterKind::kSensorOrAll)
    for (const Signal& signal : signals.sensors) names.push_back(signal.name);
  if (kind == ParameterKind::kSensorOrAll) {
    // A sensor that is its own group has one name.
    for (const std::string& group : Groups(signals))
      if (SensorsNamedBy(signals, group).size() > 1) names.push_back(group);
    names.emplace_back(kAllSensors);
  }
  if (kind == ParameterKind::kPositionSensor)
    for (const std::string_view name : kPosition.components)
      if (Has(signals, name)) names.emplace_back(name);
  if (kind == ParameterKind::kSensorVector)
    for (const auto& [name, components] : kVectors)
      if (std::all_of(components.begin(), components.end(),
                      [&](std::string_view component) { return Has(signals, component); }))
        names.emplace_back(name);
  if (kind == ParameterKind::kSensorVector)
    for (const std::string& group : Groups(signals))
      if (SensorsNamedBy(signals, group).size() == 3) names.push_back(group);
  if (kind == ParameterKind::kInput)
    for (const Signal& signal : signals.inputs)
      names.push_back(signal.name.substr(0, signal.name.rfind('_')));  // "f_r_n" -> "f_r"
  if (kind == ParameterKind::kRotor) names = signals.rotors;
  if (kind == ParameterKind::kJoint) names = signals.joints;
  return names;
}

std::optional<std::string> Unsuited(const FaultSpec& fault, const FaultType& type,
                                    const VehicleSignals& signals) {
  if (const auto* plant = type.As<PlantKind>(); plant != nullptr && plant->is_wind && !signals.feels_wind)
    return "moves only a vehicle with drag; this one's file has no <tiltproof:drag> (tiltrotor_drag has one)";
  const auto* actuator = type.As<ActuatorKind>();
  const auto named = fault.parameters.find("actuator");
  if (actuator == nullptr || !actuator->needs_force || named == fault.parameters.end()) return std::nullopt;
  const std::string* name = std::get_if<std::string>(&named->second);
  for (const Signal& input : signals.inputs)
    if (name != nullptr && input.unit == "rad" && input.name == *name + "_rad")
      return Concat({"needs a thrust or a torque; '", *name,
                     "' is a servo that is commanded by angle (plant.servo_jam and plant.servo_runaway "
                     "act on its joint)"});
  return std::nullopt;
}

std::vector<std::string> SensorsNamedBy(const VehicleSignals& signals, std::string_view name) {
  std::vector<std::string> names;
  for (const Signal& signal : signals.sensors)
    if (name == kAllSensors || (!signal.group.empty() && signal.group == name)) names.push_back(signal.name);
  return names;
}

std::size_t RotorIndex(const SignalSetup& setup) {
  const std::size_t rotor = IndexOf(setup, "rotor", ParameterKind::kRotor);
  CheckIndex(rotor, kRotorsMax, "a disturbance has a factor for each rotor");
  return rotor;
}
std::size_t JointIndex(const SignalSetup& setup) {
  const std::size_t joint = IndexOf(setup, "joint", ParameterKind::kJoint);
  CheckIndex(joint, kRotorsMax, "a disturbance has a place for each hinge");
  return joint;
}

std::size_t SensorIndex(const SignalSetup& setup, std::string_view parameter) {
  return IndexOf(setup, parameter, ParameterKind::kSensor);
}

std::size_t ActuatorIndex(const SignalSetup& setup) {
  return IndexOf(setup, "actuator", ParameterKind::kInput);
}

std::array<std::size_t, 3> SensorVectorIndices(const SignalSetup& setup) {
  const std::string& name = setup.parameters.Text("signal");
  if (const std::vector<std::string> group = SensorsNamedBy(setup.signals, name);
      group.size() == 3 && name != kAllSensors)
    return {*setup.signals.sensors.Find(group[0]), *setup.signals.sensors.Find(group[1]),
            *setup.signals.sensors.Find(group[2])};
  const auto vector = std::find_if(kVectors.begin(), kVectors.end(),
                                   [&](const VectorOfSensors& known) { return known.name == name; });
  if (vector == kVectors.end()) throw NoSuchSignal("vector", name);
  std::array<std::size_t, 3> indices{};
  for (std::size_t i = 0; i < indices.size(); ++i) {
    const auto index = setup.signals.sensors.Find(vector->components[i]);
    if (!index) throw NoSuchSignal("sensor", vector->components[i]);
    indices[i] = *index;
  }
  return indices;
}

PositionIndices PositionSensorIndices(const SignalSetup& setup) {
  const std::string& name = setup.parameters.Text("signal");
  for (std::size_t i = 0; i < kPosition.components.size(); ++i) {
    if (kPosition.components[i] != name) continue;
    if (const auto position = setup.signals.sensors.Find(name))
      return {*position, setup.signals.sensors.Find(kVelocity.components[i])};
  }
  throw NoSuchSignal("position sensor", name);
}

}  // namespace tiltproof::faults
