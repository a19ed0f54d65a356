// The tiltproof elements that a model still lacks, ready to be copied into it. Internal to LoadVehicle.
#pragma once

#include <tinyxml2.h>

#include <string>

#include "plant/vehicle_xml.h"

namespace tiltproof::plant {

// A text that says where they go, followed by the elements; empty when none is missing. Links and joints are
// the model's own, as far as its joints reveal their roles; numbers are examples.
std::string MissingElements(const tinyxml2::XMLElement& model, const VehicleElements& present);

}  // namespace tiltproof::plant
