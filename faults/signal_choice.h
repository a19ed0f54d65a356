// Sensors and actuators as parameters of a fault. Sensors go by their trace column, actuators without the
// unit.
#pragma once

#include <string_view>

#include "faults/model.h"
#include "link/signals.h"

namespace tiltproof::faults {

// `signal`: x_m ... alpha_l_rad_s.
ParameterInfo SensorParameter();
// `actuator`: f_r, f_l, tau_r, tau_l.
ParameterInfo ActuatorParameter();

// The field with a name that the parameter allows; aborts at any other.
float Sensors::*SensorNamed(std::string_view name);
double ActuatorsTruth::*ActuatorNamed(std::string_view name);

}  // namespace tiltproof::faults
