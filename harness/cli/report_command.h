// The report of a run as `run` and `report` write it.
#pragma once

#include <string>

#include "harness/report/flight_view.h"
#include "harness/report/run_view.h"
#include "plant/vehicle_model.h"

namespace tiltproof::harness {

std::string PageOf(const RunView& view);

// The vehicle as the page draws it.
VehicleShape ShapeOf(const plant::VehicleModel& model);

}  // namespace tiltproof::harness
