// Sensors, actuators and parts of the vehicle as parameters of a fault. Sensors are named by their trace column,
// actuators by the column of the input without its unit, rotors and joints as in the vehicle's file. The registry checks that a parameter looks like a name; whether the
// vehicle has such a signal is checked where the vehicle is known:
//
//   const std::vector<std::string> names = SignalNames(model.signals(), ParameterKind::kInput);  // f_r, f_l, ...
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "faults/fault_type.h"
#include "faults/model.h"
#include "faults/parameters.h"

namespace tiltproof::faults {

// In place of a sensor's name: every sensor of the vehicle, each with a model and draws of its own. The name of a group
// (Signal::group) stands for the sensors in it in the same way.
inline constexpr std::string_view kAllSensors = "all";
// `signal`: for the tilt-rotor x_m ... alpha_l_rad_s, or kAllSensors.
ParameterInfo SensorParameter();
// The same, of a fault that needs one.
ParameterInfo OneSensorParameter();
// `signal`, of a fault on a position alone: for the tilt-rotor x_m, y_m, z_m.
ParameterInfo PositionParameter();
// `signal`, of a fault on three sensors at once: for the tilt-rotor position, velocity, rates.
ParameterInfo SensorVectorParameter();
// `actuator`: for the tilt-rotor f_r, f_l, tau_r, tau_l.
ParameterInfo ActuatorParameter();
// `rotor`: for the tilt-rotor right, left.
ParameterInfo RotorParameter();
// `joint`: for the tilt-rotor hinge_right, hinge_left.
ParameterInfo JointParameter();

// Letters, digits and '_', beginning with a letter; 1 to this many characters.
inline constexpr std::size_t kSignalNameMax = 100;
bool IsSignalName(std::string_view text);

// The values that a parameter of this kind (one of NamesSignal() or NamesPart()) may have for a vehicle with these signals, in
// the order of its table.
std::vector<std::string> SignalNames(const VehicleSignals& signals, ParameterKind kind);

// The reason that a fault cannot do to this vehicle what it models, as words behind the type's name: wind, on a
// vehicle without drag; a fault of force, on a servo that is commanded by angle. None: it can.
std::optional<std::string> Unsuited(const FaultSpec& fault, const FaultType& type,
                                    const VehicleSignals& signals);

// The sensors that kAllSensors or the name of a group stands for; none for any other name.
std::vector<std::string> SensorsNamedBy(const VehicleSignals& signals, std::string_view name);

// The place, in a row of sensors or of inputs, of the signal that a parameter names. Throws
// std::invalid_argument when the vehicle has no such signal.
std::size_t SensorIndex(const SignalSetup& setup, std::string_view parameter = "signal");
std::size_t ActuatorIndex(const SignalSetup& setup);
// The place of the named part among the rotors or hinges of a Disturbance. Throws like SensorIndex().
std::size_t RotorIndex(const SignalSetup& setup);
std::size_t JointIndex(const SignalSetup& setup);

// Sensors that are the x, y and z components of one vector. A vehicle has the vector when it has all three:
//
//   position   x_m       y_m       z_m
//   velocity   vx_m_s    vy_m_s    vz_m_s
//   rates      wx_rad_s  wy_rad_s  wz_rad_s
//
// A group of three sensors (acc, gyro, mag) is a vector, too.
//
// Their places in a row of sensors. Throws std::invalid_argument when the vehicle has no such vector.
std::array<std::size_t, 3> SensorVectorIndices(const SignalSetup& setup);

// A sensor of a position, and the sensor of the velocity along the same axis, where the vehicle has one.
struct PositionIndices {
  std::size_t position;
  std::optional<std::size_t> velocity;
};
PositionIndices PositionSensorIndices(const SignalSetup& setup);

}  // namespace tiltproof::faults
