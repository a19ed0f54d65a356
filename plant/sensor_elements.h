// Reads the sensors of a vehicle from SDF's <sensor>. Internal to LoadVehicle.
#pragma once

#include <sdf/Model.hh>
#include <string>
#include <string_view>
#include <vector>

#include "plant/sdf_files.h"
#include "plant/vehicle_elements.h"
#include "plant/vehicle_model.h"

namespace tiltproof::plant {

// imu, magnetometer, air_pressure, navsat, and gps, its old name.
bool IsSensorType(std::string_view type);

// Checks the numbers of all sensors of these types. Adds a problem for a text that is not a number, or out of range,
// because libsdformat would take its default, or the start of the text.
void CheckSensorNumbers(const SdfFiles& files, std::vector<VehicleProblem>& problems);

// The sensors on links that are rigid with the base, in the order of the links in LoadSdf's flat model. One on the body
// of a hinge of `vehicle`, whose hinges are there, is left out with a warning.
std::vector<Sensor> ReadSensors(const sdf::Model& flat, const SdfFiles& files,
                                const VehicleElements& elements, const VehicleModel& vehicle,
                                std::vector<std::string>& warnings, std::vector<VehicleProblem>& problems);

}  // namespace tiltproof::plant
